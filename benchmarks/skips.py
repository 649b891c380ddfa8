"""Methods that a cell cannot serve, such as those without weights, are asked for once and then left out."""

from collections.abc import Iterable

from benchmarks.protocol import Trial
from medor_wire.errors import BadRequest, MedorError


class Skips:
    """Methods that were refused before their first pick, as those without weights are: not asked again.

    By category, because weights may be. A method that has finished an episode is not skipped.
    """

    def __init__(self, finished: Iterable[str]) -> None:
        self._works = {_of(Trial.of(key)) for key in finished}
        self._reasons: dict[tuple[str, str], str] = {}

    def reason(self, trial: Trial) -> str | None:
        return self._reasons.get(_of(trial))

    def works(self, trial: Trial) -> None:
        self._works.add(_of(trial))

    def refused(self, trial: Trial, error: MedorError) -> None:
        if type(error) is BadRequest and _of(trial) not in self._works:
            self._reasons[_of(trial)] = told(error)


def _of(trial: Trial) -> tuple[str, str]:
    return trial.method, trial.category


def told(error: MedorError) -> str:
    """An error in a line."""
    return f"{error.code}: {error}"
