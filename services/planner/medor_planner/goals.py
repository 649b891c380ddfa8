"""Goal poses of `canonicalize`, made once per garment."""

import threading
from functools import lru_cache

from medor_cloth.garment import generate
from medor_planner.methods import Method
from medor_wire import endpoints
from medor_wire.bus import Bus
from medor_wire.content import ByContent
from medor_wire.errors import BadRequest
from medor_wire.messages import Category, ClothMesh, FlattenRequest, GoalSet, Reward

TEMPLATE_SEED = 700_001
"""The garment that stands for its category when the mesh has no canonical pose; of the training seeds."""
KEEP = 16
"""Goal sets kept."""


class Goals:
    """Asks dynamics for goal sets and keeps the last ones, by the canonical mesh they were made of."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._flattened = lru_cache(KEEP)(self._flatten)

    def reward(self, method: Method, mesh: ClothMesh, cancel: threading.Event) -> Reward:
        """How states of `mesh` are scored by their distance to the goals of the method."""
        request = canonical_of(mesh) if method.goals == "mesh" else template(mesh.category)
        return Reward(
            task="canonicalize",
            goals=self.of(request, cancel).goals,
            matched=method.goals == "mesh",
            visible_only=method.visible_reward,
        )

    def of(self, request: FlattenRequest, cancel: threading.Event) -> GoalSet:
        """The goal poses of a canonical pose, and the coverage of the garment laid flat."""
        arrays = (request.canonical, request.faces, request.panel_uv)
        return self._flattened(ByContent.of((request, cancel), request.category, *arrays))

    def _flatten(self, asked: ByContent[tuple[FlattenRequest, threading.Event]]) -> GoalSet:
        request, cancel = asked.value
        return self._bus.ask(endpoints.FLATTEN, request, cancel=cancel)


def canonical_of(mesh: ClothMesh) -> FlattenRequest:
    """The mesh's own canonical pose."""
    if mesh.canonical is None:
        raise BadRequest("canonicalize with the mesh's own goals needs a mesh with canonical coordinates")
    return FlattenRequest(category=mesh.category, canonical=mesh.canonical, faces=mesh.faces, panel_uv=mesh.panel_uv)


@lru_cache
def template(category: Category) -> FlattenRequest:
    """The canonical pose of the category's fixed garment."""
    garment = generate(category, TEMPLATE_SEED)
    return FlattenRequest(category=category, canonical=garment.vertices, faces=garment.faces, panel_uv=garment.panel_uv)
