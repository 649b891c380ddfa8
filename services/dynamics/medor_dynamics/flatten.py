"""Goal poses of a garment: its canonical mesh laid flat, once per symmetry element (MEDOR, canonicalization)."""

from functools import lru_cache

from medor_cloth.coverage import coverage
from medor_cloth.errors import ClothError
from medor_cloth.garment import Garment
from medor_cloth.goals import goal_set
from medor_wire.bus import Call
from medor_wire.content import ByContent
from medor_wire.errors import BadRequest
from medor_wire.messages import FlattenRequest, GoalSet


class Flattener:
    """Makes goal sets and keeps the last ones, by content."""

    def __init__(self, keep: int = 16) -> None:
        self._goals_of = lru_cache(keep)(goals_of)

    def flatten(self, request: FlattenRequest, call: Call) -> GoalSet:
        """The goal poses of a canonical mesh and the coverage of the first.

        Raises:
            BadRequest: a mesh that cannot be cloth.
        """
        call.check()
        return self._goals_of(
            ByContent.of(request, request.category, request.canonical, request.faces, request.panel_uv)
        )


def goals_of(request: ByContent[FlattenRequest]) -> GoalSet:
    asked = request.value
    garment = Garment(asked.category, None, asked.canonical, asked.faces, asked.panel_uv)
    try:
        goals = goal_set(garment)
    except ClothError as error:
        raise BadRequest(f"the canonical mesh cannot be laid flat: {error}") from error
    return GoalSet(goals=goals, flat_coverage_m2=coverage(goals[0], garment.faces))
