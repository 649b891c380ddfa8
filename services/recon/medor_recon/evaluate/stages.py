"""The stages of all methods on one observation; what methods share is computed once."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from medor_recon.canonicalized import Canonicalized
from medor_recon.completed import Completed
from medor_recon.evaluate.metrics import canonical_measures, mesh_measures
from medor_recon.evaluate.observed import Observed
from medor_recon.methods import Method
from medor_recon.refine import Refined, refine
from medor_wire.errors import ReconstructionFailed

T = TypeVar("T")


@dataclass(frozen=True)
class Source:
    """Where the first two stages come from: networks, or the truth.

    Attributes:
        canonicalize: an observation and the preset of a network to the canonical coordinates of its pixels.
        complete: an observation, these, and the preset of a completion to a mesh.
    """

    canonicalize: Callable[[Observed, str], Canonicalized]
    complete: Callable[[Observed, Canonicalized, str], Completed]


class Stages:
    """One observation on its way through the methods."""

    def __init__(self, observed: Observed, source: Source) -> None:
        self.observed = observed
        self._source = source
        self._done: dict[tuple[object, ...], tuple[Any, float]] = {}

    def canonicalized(self, method: Method) -> Canonicalized:
        return self._timed(self._source.canonicalize, self.observed, method.canonical)[0]

    def completed(self, method: Method) -> Completed:
        """Raises `ReconstructionFailed`."""
        return self._timed(self._source.complete, self.observed, self.canonicalized(method), method.completion)[0]

    def refined(self, method: Method) -> Refined:
        """Raises `ReconstructionFailed`."""
        return self._timed(refine, self.completed(method), self.canonicalized(method), method.refine)[0]

    def record(self, method: Method) -> dict[str, Any]:
        """A method's measures `before` and `after` finetuning and CPU seconds of its stages, or why it `failed`."""
        name = {"observation": self.observed.key, "category": self.observed.category, "method": method.name}
        try:
            seen, completed, refined = self.canonicalized(method), self.completed(method), self.refined(method)
        except ReconstructionFailed as error:
            return name | {"failed": str(error)}
        canonical, turn = self._timed(canonical_measures, seen, self.observed)[0]
        before = self._timed(mesh_measures, completed, completed.positions, seen, self.observed, turn)[0]
        after = mesh_measures(completed, refined.positions, seen, self.observed, turn) if method.refine else before
        seconds = {
            "seconds_canonicalize": self._timed(self._source.canonicalize, self.observed, method.canonical)[1],
            "seconds_complete": self._timed(self._source.complete, self.observed, seen, method.completion)[1],
            "seconds_refine": self._timed(refine, completed, seen, method.refine)[1],
        }
        return name | {"before": canonical | before, "after": canonical | after | seconds}

    def _timed(self, stage: Callable[..., T], *given: Any) -> tuple[T, float]:
        """A stage's result and its CPU seconds; the same stage with the same things given runs once."""
        key = (stage, *(one if isinstance(one, str) else id(one) for one in given))
        if key not in self._done:
            started = time.process_time()
            result = stage(*given)
            self._done[key] = result, time.process_time() - started
        return self._done[key]
