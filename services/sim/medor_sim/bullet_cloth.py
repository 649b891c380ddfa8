"""The engine `bullet`: PyBullet's soft body in place of our solver, a second physics that nothing is trained on."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from medor_cloth.cloth import Cloth
from medor_cloth.errors import ClothError
from medor_cloth.garment import Garment
from medor_cloth.grasp import grasp
from medor_cloth.integration import FRAME_S
from medor_cloth.solver import PARKED, ClothState
from medor_sim.soft_body import SoftBody

EDGE_M = 0.016
"""Mean edge length of the garments generated for it: 370 to 630 vertices, what PyBullet's cloth is stable with."""
MAX_VERTICES = 700
FALLEN_M = -0.05
"""Cloth so far below the table's top has fallen through it, as PyBullet lets it now and then [m]."""
CALM_SHARE = 0.995
"""Share of the vertices that must be slow in a settled cloth."""


class BulletCloth:
    """Moves one cloth with PyBullet (`medor_cloth.engine.Engine`). For one thread at a time.

    PyBullet cannot set velocities. The state returned last goes on as it moves, also after something touched it; any
    other begins at rest, and so does one in which a picker is placed. What an action does follows from the positions
    it begins with alone.

    Args:
        garment: At most `MAX_VERTICES` vertices.
        cloth: Of this garment.

    Raises:
        ClothError: The garment has too many vertices.
    """

    def __init__(self, garment: Garment, cloth: Cloth):
        if cloth.n_vertices > MAX_VERTICES:
            raise ClothError(
                f"{cloth.n_vertices} vertices; PyBullet's cloth gains energy above {MAX_VERTICES}: "
                "simplify the mesh, or use the engine xpbd"
            )
        self.cloth = cloth
        self._rest_shape = rest_shape(garment, cloth)
        self._body: SoftBody | None = None
        self._latest: ClothState | None = None

    def rest(self, positions: ArrayLike) -> ClothState:
        """The cloth at the given positions (V,3) [m], not moving, the picker parked."""
        x = np.array(positions, np.float32, order="C")
        if x.shape != (self.cloth.n_vertices, 3) or not np.isfinite(x).all():
            raise ClothError(f"expected finite positions ({self.cloth.n_vertices}, 3), got {x.shape}")
        return ClothState(x, np.zeros_like(x), -1, PARKED.copy(), 0, 0)

    def placed(self, state: ClothState, picker: ArrayLike) -> ClothState:
        """The cloth where it is in a state, at rest, with an empty picker at (3,) [m]."""
        return replace(self.rest(state.positions), picker=np.array(picker, np.float32), frame=state.frame)

    def advance(
        self,
        state: ClothState,
        frames: int,
        *,
        picker_path: ArrayLike | None = None,
        holding: ArrayLike | None = None,
        settle_speed: float | None = None,
    ) -> ClothState:
        """The cloth at most some frames of 0.01 s later; see `medor_cloth.solver.Solver.advance`.

        Raises:
            ClothError: The cloth flew apart, or fell through the table.
        """
        path = np.broadcast_to(
            state.picker if picker_path is None else np.asarray(picker_path, np.float32), (frames, 3)
        )
        closed = np.broadcast_to(False if holding is None else np.asarray(holding, bool), (frames,))
        body, now = self._body_of(state), state.copy()
        for k in range(frames):
            held = _grip(body, now, closed[k])
            body.step(path[k] - now.picker)
            now = self._after(now, body.positions(), held, path[k], settle_speed)
            if now.settled:
                break
        self._latest = now
        return now

    def _body_of(self, state: ClothState) -> SoftBody:
        """The body that is in this state: the present one if it just came to it, else a new one, at rest."""
        latest = self._latest
        if self._body is None or latest is None or state.frame != latest.frame or not state.velocities.any():
            self.close()
            self._body = SoftBody(self._rest_shape, self.cloth.faces, state.positions)
            if state.held >= 0:
                self._body.hold(state.held)
        elif state is not latest:
            self._body.move_to(state.positions)
        return self._body

    def close(self) -> None:
        """End the present body's world, if there is one; the engine can be used on."""
        if self._body is not None:
            self._body.close()
        self._body = None

    @staticmethod
    def _after(
        before: ClothState, positions: NDArray[np.float32], held: int, picker: NDArray, settle_speed: float | None
    ) -> ClothState:
        """The state one frame after another."""
        if not np.isfinite(positions).all():
            raise ClothError("PyBullet's cloth flew apart")
        if positions[:, 2].min() < FALLEN_M:
            raise ClothError("PyBullet's cloth fell through the table")
        velocities = (positions - before.positions) / np.float32(FRAME_S)
        slow = np.linalg.norm(velocities, axis=1) <= (settle_speed or 0)
        calm = before.calm + 1 if settle_speed and slow.mean() >= CALM_SHARE else 0
        return ClothState(positions, velocities, held, np.array(picker, np.float32), before.frame + 1, calm)


def _grip(body: SoftBody, now: ClothState, closed: bool) -> int:
    """Open the picker, or close it on what it reaches; the vertex it then holds, -1 for none."""
    if not closed:
        body.release()
        return -1
    if now.held >= 0:
        return now.held
    vertex = grasp(now.positions, now.picker)
    if vertex >= 0:
        body.hold(vertex)
    return vertex


def rest_shape(garment: Garment, cloth: Cloth) -> NDArray[np.float32]:
    """Positions (V,3) [m] with edges nearest to the cloth's rest lengths: PyBullet's rest lengths are a mesh's edges.

    Laid flat for a garment with panels (0.5–1 % off, the worn pose is 2–3 % off), worn for one without (exact).
    """
    return min((garment.laid_flat(), garment.vertices), key=lambda shape: _misfit(cloth, shape))


def _misfit(cloth: Cloth, shape: NDArray[np.float32]) -> float:
    lengths = np.linalg.norm(shape[cloth.edges[:, 0]] - shape[cloth.edges[:, 1]], axis=1)
    return float(np.square(lengths / cloth.rest_lengths - 1).mean())
