"""Screening: a rough model rates all candidates, so that the method's own model need roll only the best ones out.

What is left is chosen from by the method's own model, so screening can cost the best candidate but never mistake a bad
one for it.
"""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from medor_planner.sampling import Candidates
from medor_wire.errors import BadRequest

log = logging.getLogger(__name__)

BACKEND = "coarse"
KEEP = 0.15
"""Share of the candidates that survives."""
SCREEN_CHUNK = 50
"""Candidates per request to rate them: about as much work as to roll out a third of them."""
AT_LEAST = 20
"""Survivors that a plan has in any case: those it reports."""


@dataclass
class Screening:
    """Chooses survivors by a backend's rewards.

    Attributes:
        backend: of dynamics; empty: none, all candidates survive.
        keep: share that survives.
    """

    backend: str = BACKEND
    keep: float = KEEP
    _told: set[str] = field(default_factory=set, init=False)

    def leaves(self, count: int) -> int:
        """How many of some candidates survive."""
        return min(count, max(math.ceil(self.keep * count), AT_LEAST)) if self.backend else count

    def survivors(
        self, candidates: Candidates, rewards: Callable[[Candidates, str], NDArray[np.float64]]
    ) -> Candidates:
        """The best candidates, in their order; all of them when the backend refuses.

        Args:
            candidates: K of them.
            rewards: asks a backend to rate candidates, (K,).
        """
        try:
            rated = rewards(candidates, self.backend)
        except BadRequest as refused:  # a fault of the question the method's own model refuses as well
            self._tell(str(refused))
            return candidates
        return candidates.where(best(rated, self.leaves(len(rated))))

    def _tell(self, reason: str) -> None:
        if reason not in self._told:
            self._told.add(reason)
            log.warning("plans without screening, every candidate is rolled out: %s", reason)


def best(rated: NDArray, count: int) -> NDArray[np.bool_]:
    """(K,) so many of K rated candidates that are rated best."""
    return np.isin(np.arange(len(rated)), np.argsort(-rated, kind="stable")[:count])
