"""A garment in the vertex block descent (VBD) solver of newton: a slow reference of another make.

Needs `pip install newton` (Apache-2.0), which nothing else of the project does. It has no code in common with our
solver and little of its physics: Neo-Hookean membrane elements, dihedral bending, vertex–triangle and edge–edge contact
with a barrier, motions cut off before anything is crossed. What the two are told alike: rest shape, seams that fold
freely, thickness, friction, gravity, the picker's rules. Its bending is that of a soft cotton of 0.2 kg/m², chosen so
that strips of 5 to 10 cm held at their middle droop about as far as in ours.
"""

from dataclasses import replace

import newton  # pyright: ignore[reportMissingImports]
import numpy as np
import warp  # pyright: ignore[reportMissingImports]
from newton.solvers import SolverVBD  # pyright: ignore[reportMissingImports]
from numpy.typing import ArrayLike, NDArray

from medor_cloth.cloth import Cloth
from medor_cloth.garment import Garment
from medor_cloth.grasp import grasp
from medor_cloth.integration import CALM_FRAMES, FRAME_S
from medor_cloth.solver import PARKED, ClothState, SolverConfig

STEPS = 5
"""Steps of a frame."""
STEP_S = FRAME_S / STEPS
ITERATIONS = 5
"""Descents over all vertices in a step."""
DENSITY = 0.2
"""Mass of the cloth [kg/m²]: a T-shirt's."""
STRETCH = 200.0
"""Lamé constants of the membrane [N/m]: the heaviest garment hangs from one vertex without visible stretch."""
STRETCH_DAMPING = 1e-4
BENDING = 2e-4
"""Stiffness of bending [N]: torque over angle and length of the edge."""
BENDING_DAMPING = 1e-7
CONTACT = 30.0
"""Stiffness of contact [N/m]."""
CONTACT_DAMPING = 1e-3
TABLE = 2000.0
"""Stiffness of contact with the table [N/m]: nothing presses the cloth into it."""
HOLD = 1e5
"""How much heavier a held vertex is: it goes where its velocity says, unless that is through cloth."""
GAP = 0.8
"""Way beyond the thickness in which contacts are looked for, over the thickness; no vertex moves farther than about
0.4 of the sum in a step, so none falls faster than 1.9 m/s."""
SLIP = 1e-3
"""Speed below which friction fades [m/s]."""


class Vbd:
    """Moves one cloth as `medor_cloth.engine.Engine` says; positions and velocities are its whole state.

    Args:
        garment: What to move.
        bending: Stiffness of bending [N].
        config: Whose thickness, friction and gravity to take.
    """

    def __init__(self, garment: Garment, bending: float = BENDING, config: SolverConfig | None = None):
        config = config or SolverConfig()
        self.cloth = Cloth.from_mesh(garment.vertices, garment.faces, garment.panel_uv)
        self._model = _model(garment, self.cloth, bending, config)
        self._pipeline = newton.CollisionPipeline(self._model, soft_contact_gap=config.thickness)
        self._contacts = self._pipeline.contacts()
        self._control = self._model.control()
        self._solver = SolverVBD(
            self._model,
            iterations=ITERATIONS,
            friction_epsilon=SLIP,
            particle_enable_self_contact=True,
            particle_self_contact_margin=config.thickness,
            particle_self_contact_gap=GAP * config.thickness,
            particle_vertex_contact_buffer_size=64,
            particle_edge_contact_buffer_size=128,
        )
        self._height = config.thickness / 2
        self._fall = np.array([0, 0, -config.gravity * STEP_S], np.float32)

    def rest(self, positions: ArrayLike) -> ClothState:
        """The cloth at the given positions (V,3) [m], not moving, the picker parked."""
        x = np.array(positions, np.float32, order="C")
        return ClothState(x, np.zeros_like(x), -1, PARKED.copy(), 0, 0)

    def placed(self, state: ClothState, picker: ArrayLike) -> ClothState:
        """The same state with an empty picker at another place (3,) [m]."""
        return replace(state, picker=np.array(picker, np.float32), held=-1)

    def advance(
        self,
        state: ClothState,
        frames: int,
        *,
        picker_path: ArrayLike | None = None,
        holding: ArrayLike | None = None,
        settle_speed: float | None = None,
    ) -> ClothState:
        """The cloth at most some frames of 0.01 s later; see `medor_cloth.solver.Solver.advance`."""
        path = np.broadcast_to(state.picker, (frames, 3)) if picker_path is None else np.asarray(picker_path)
        closed = np.zeros(frames, bool) if holding is None else np.asarray(holding, bool)
        now = state.copy()
        for target, shut in zip(path, closed, strict=True):
            now = self._frame(now, np.asarray(target, np.float32), bool(shut))
            speed = np.linalg.norm(now.velocities, axis=1)
            slow = settle_speed is not None and np.mean(speed > settle_speed) <= 0.005
            now.calm = now.calm + 1 if slow else 0
            if now.calm >= CALM_FRAMES:
                break
        return now

    def _frame(self, state: ClothState, target: NDArray[np.float32], closed: bool) -> ClothState:
        held = -1 if not closed else state.held if state.held >= 0 else grasp(state.positions, state.picker)
        before, after = self._model.state(), self._model.state()
        before.particle_q.numpy()[:], before.particle_qd.numpy()[:] = state.positions, state.velocities
        self._weigh(held, HOLD)
        for step in range(STEPS):
            if held >= 0:
                way = state.positions[held] + (target - state.picker) * (step + 1) / STEPS
                way[2] = max(way[2], self._height)
                before.particle_qd.numpy()[held] = (way - before.particle_q.numpy()[held]) / STEP_S - self._fall
            before.clear_forces()
            self._pipeline.collide(before, self._contacts)
            self._solver.step(before, after, self._control, self._contacts, STEP_S)
            before, after = after, before
        self._weigh(held, 1 / HOLD)
        x, v = before.particle_q.numpy().copy(), before.particle_qd.numpy().copy()
        return ClothState(x, v, held, target.copy(), state.frame + 1, state.calm)

    def _weigh(self, vertex: int, factor: float) -> None:
        """Multiplies the mass of a vertex, if there is one."""
        if vertex >= 0:
            self._model.particle_mass.numpy()[vertex] *= factor
            self._model.particle_inv_mass.numpy()[vertex] /= factor


def _model(garment: Garment, cloth: Cloth, bending: float, config: SolverConfig) -> newton.Model:
    """The garment over a table. The worn shape tells which layers are neighbours, the panels the shape at rest."""
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, -config.gravity))
    ground = newton.ModelBuilder.ShapeConfig(
        ke=2 * TABLE - CONTACT, kd=CONTACT_DAMPING, mu=config.table_friction**2 / config.layer_friction
    )
    builder.add_ground_plane(cfg=ground)
    builder.add_cloth_mesh(
        pos=(0, 0, 0),
        rot=warp.quat_identity(),
        scale=1.0,
        vel=(0, 0, 0),
        vertices=garment.vertices.tolist(),
        indices=garment.faces.ravel().tolist(),
        density=DENSITY,
        tri_ke=STRETCH,
        tri_ka=STRETCH,
        tri_kd=STRETCH_DAMPING,
        edge_ke=bending,
        edge_kd=BENDING_DAMPING,
        particle_radius=config.thickness / 2,
    )
    builder.color(include_bending=True)
    model = builder.finalize(device="cpu")
    model.soft_contact_ke, model.soft_contact_kd = CONTACT, CONTACT_DAMPING
    model.soft_contact_mu = config.layer_friction  # with the table: the geometric mean of both
    _set_rest_shape(model, garment, cloth)
    return model


def _set_rest_shape(model: newton.Model, garment: Garment, cloth: Cloth) -> None:
    """Faces as large as in their panels, bent nowhere, and free to fold at the seams."""
    corners = garment.vertices[garment.faces] if garment.panel_uv is None else garment.panel_uv
    inverse, areas = _rest_frames(corners.astype(np.float64))
    model.tri_poses.numpy()[:] = inverse
    model.tri_areas.numpy()[:] = areas
    mass = np.bincount(garment.faces.ravel(), np.repeat(DENSITY * areas / 3, 3), cloth.n_vertices)
    model.particle_mass.numpy()[:] = mass
    model.particle_inv_mass.numpy()[:] = 1 / mass
    wings = np.sort(model.edge_indices.numpy()[:, :2], axis=1)
    key = np.array([cloth.n_vertices, 1])
    bends = np.isin(wings @ key, np.sort(cloth.bend.pairs, axis=1) @ key)
    model.edge_bending_properties.numpy()[~bends] = 0
    model.edge_rest_angle.zero_()
    sides = np.sort(model.edge_indices.numpy()[:, 2:], axis=1) @ key
    own = np.sort(cloth.edges, axis=1) @ key
    order = np.argsort(own)
    model.edge_rest_length.numpy()[:] = cloth.rest_lengths[order][np.searchsorted(own[order], sides)]


def _rest_frames(corners: NDArray) -> tuple[NDArray, NDArray]:
    """Inverses (F,2,2) of the matrices whose columns are two sides of each face at rest, and the areas (F,) [m²]."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    length = np.linalg.norm(a, axis=1)
    along = (a * b).sum(1) / length
    height = np.sqrt((b * b).sum(1) - along**2)
    frames = np.zeros((len(corners), 2, 2))
    frames[:, 0, 0], frames[:, 0, 1], frames[:, 1, 1] = length, along, height
    return np.linalg.inv(frames), length * height / 2
