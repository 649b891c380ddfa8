"""What lies on the simulated table, and its figures. A scene is never changed: every action makes a new one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from medor_cloth.alignment import canonical_cost
from medor_cloth.camera import Camera
from medor_cloth.coverage import coverage
from medor_cloth.improvement import normalized_improvement_canonical, normalized_improvement_flatten
from medor_cloth.picker import SETTLE_FRAMES, SETTLED_SPEED, pull
from medor_cloth.raster import visible_vertices
from medor_cloth.solver import ClothState
from medor_cloth.start import dropped, picked
from medor_sim.wardrobe import Piece
from medor_wire.errors import MedorError
from medor_wire.messages import ClothMesh, Score, StartState, Truth

SLICE_FRAMES = 5
"""A stop takes effect within this many frames."""
MIN_COST_M = 0.001
"""A start nearer to its goal than this leaves nothing to improve."""
STATES: tuple[StartState, ...] = ("drop", "flat", "picks")


Touch = Callable[[int, ClothState], ClothState]
"""The cloth after something touched it at the end of a frame of the path, given the frame's number."""


class Pulled(NamedTuple):
    """What came of a pull."""

    scene: "Scene"
    grasped: bool
    stopped: MedorError | None
    """Why it was cut short."""
    walked: int
    """Frames of the path."""


@dataclass(frozen=True)
class Scene:
    """A garment on the table and where its episode began."""

    piece: Piece
    cloth: ClothState
    start_coverage: float
    """Coverage at the reset [m²]."""
    start_cost: float
    """Canonical cost at the reset [m]."""
    picks: int = 0

    @classmethod
    def begin(cls, piece: Piece, state: StartState, seed: int) -> "Scene":
        """A start state; the same garment, state and seed give the same scene."""
        cloth = start_state(piece, state, seed)
        area = coverage(cloth.positions, piece.garment.faces)
        return cls(piece, cloth, area, float(canonical_cost(cloth.positions, piece.goals)))

    def pulled(self, pick: np.ndarray, place: np.ndarray, check: Callable[[], None]) -> "Pulled":
        """The scene after one pick-and-place of the flying picker: the motion of `medor_cloth.picker.pick_place`."""
        path = pull(pick, place)
        return self.carried(pick, path, np.ones(len(path), bool), check)

    def carried(
        self,
        start: np.ndarray,
        path: np.ndarray,
        holding: np.ndarray,
        check: Callable[[], None],
        touches: Sequence[Touch] = (),
    ) -> "Pulled":
        """The scene after the picker has walked a path, then opened, and the cloth has settled: one action.

        It is at rest then, whatever speed is left in it: seconds pass before the next action begins.

        Args:
            start: Centre of the empty picker when the walk begins (3,) [m].
            path: Its centre at the end of each frame of 0.01 s (T,3) [m].
            holding: Whether it is closed in each frame (T,).
            check: May raise between slices of the walk to stop it: then the picker opens where it is, and the cloth
                falls and settles.
            touches: What else acts on the cloth, in this order after every frame.
        """
        engine = self.piece.engine
        now, grasped, stopped, walked = engine.placed(self.cloth, start), False, None, 0
        try:
            while walked < len(path):
                check()
                part = slice(walked, walked + (1 if touches else SLICE_FRAMES))
                now = engine.advance(now, len(path[part]), picker_path=path[part], holding=holding[part])
                for touch in touches:
                    now = touch(walked, now)
                grasped |= now.held >= 0
                walked += len(path[part])
        except MedorError as error:
            stopped = error
        now = engine.advance(now, SETTLE_FRAMES, settle_speed=SETTLED_SPEED)
        at_rest = replace(engine.rest(now.positions), frame=now.frame)
        return Pulled(replace(self, cloth=at_rest, picks=self.picks + 1), grasped, stopped, walked)

    def score(self) -> Score:
        """The referee's figures. An improvement is 0 where the start left no room for one."""
        best = self.piece.flat_coverage
        now = coverage(self.cloth.positions, self.piece.garment.faces)
        cost = float(canonical_cost(self.cloth.positions, self.piece.goals))
        can_spread, can_align = self.start_coverage < best, self.start_cost > MIN_COST_M
        flatten = normalized_improvement_flatten(now, self.start_coverage, best) if can_spread else 0.0
        canonical = normalized_improvement_canonical(cost, self.start_cost) if can_align else 0.0
        return Score(
            coverage_m2=now,
            flat_coverage_m2=best,
            ni_flatten=float(flatten),
            ni_canonicalize=float(canonical),
            canonical_cost_m=cost,
            picks=self.picks,
        )

    def truth(self, camera: Camera) -> Truth:
        garment = self.piece.garment
        mesh = ClothMesh(
            vertices=self.cloth.positions,
            faces=garment.faces,
            category=self.piece.category,
            visible=visible_vertices(self.cloth.positions, garment.faces, camera),
            canonical=garment.vertices,
            panel_uv=garment.panel_uv,
        )
        return Truth(mesh=mesh, garment_id=self.piece.id)


def start_state(piece: Piece, state: StartState, seed: int) -> ClothState:
    """The garment as an episode finds it: dropped, flat, or flat and then disturbed by random picks."""
    rng = np.random.default_rng([STATES.index(state), seed])
    if state == "drop":
        return dropped(piece.engine, piece.flat, rng, piece.max_start_coverage)
    if state == "picks":
        return picked(piece.engine, piece.flat, rng)
    return piece.flat
