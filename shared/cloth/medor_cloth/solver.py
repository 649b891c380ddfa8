"""The cloth solver: position-based dynamics (XPBD) of one garment on a table, deterministic to the bit."""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from medor_cloth.cloth import Cloth
from medor_cloth.errors import ClothError
from medor_cloth.integration import CALM_FRAMES, FRAME_S, Physics, Topology, simulate


@dataclass(frozen=True)
class SolverConfig:
    """Constants of the solver. SI units; the vertices have unit mass."""

    substeps: int = 12
    """Substeps of a frame of 0.01 s."""
    gravity: float = 9.81
    drag: float = 1.0
    """Share of its velocity a vertex loses a second, as to the air [1/s]."""
    top_speed: float = 3.0
    """No vertex flies faster [m/s]; less than half a thickness a substep, so no layer is jumped over."""
    thickness: float = 0.005
    """Distance kept between two layers; twice the height of a layer over the table [m]."""
    table_friction: float = 1.2
    layer_friction: float = 0.8
    push_out: float = 0.7
    """Speed at which overlapping layers separate at most [m/s]."""
    bend_compliance: float = 1e-3
    """Compliance of bending at edges of 12 mm; scaled by (edge / 12 mm)³ for other meshes."""
    compression: float = 0.15
    """Share of a spring's correction that acts against compression, in each pass; cloth buckles."""
    spring_damping: float = 0.4
    """Share of the relative velocity along each spring that is taken away every fourth substep."""
    spring_passes: int = 4
    """Times the stretching springs are relaxed in a substep. More make the cloth stretch less and rest more quietly;
    with twice as many it folds like cardboard."""
    contact_damping: float = 0.5
    """Share of the relative velocity along the normal of each contact that is taken away every fourth substep."""
    layers: bool = True
    """Whether layers touch. Without, they pass through each other and all rest on the table: for meshes whose layers
    run through each other to begin with, which contact would tear apart."""

    def softer(self, times: float) -> "SolverConfig":
        """The same cloth, so many times as easy to bend."""
        return replace(self, bend_compliance=self.bend_compliance * times)


@dataclass
class ClothState:
    """Everything the solver knows of a cloth between two frames.

    Attributes:
        positions: (V,3) float32 world frame [m].
        velocities: (V,3) float32 [m/s].
        held: Vertex in the picker, -1 for none.
        picker: Centre of the picker (3,) float32 [m].
        frame: Frames since the cloth was laid down.
        calm: Frames in a row the cloth has been slow for.
    """

    positions: NDArray[np.float32]
    velocities: NDArray[np.float32]
    held: int
    picker: NDArray[np.float32]
    frame: int
    calm: int

    @property
    def settled(self) -> bool:
        """Whether the cloth was slow for long enough to count as settled."""
        return self.calm >= CALM_FRAMES

    def copy(self) -> "ClothState":
        """A state that shares no memory with this one."""
        return replace(
            self,
            positions=self.positions.copy(),
            velocities=self.velocities.copy(),
            picker=self.picker.copy(),
        )

    def to_arrays(self) -> dict[str, np.ndarray]:
        """The state as named arrays, exact to the bit."""
        return {field.name: np.asarray(getattr(self, field.name)) for field in fields(self)}

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> "ClothState":
        """The state that `to_arrays` wrote."""
        missing = {field.name for field in fields(cls)} - set(arrays)
        if missing:
            raise ClothError(f"a cloth state needs the arrays {sorted(missing)}")
        return cls(
            positions=np.array(arrays["positions"], np.float32),
            velocities=np.array(arrays["velocities"], np.float32),
            held=int(arrays["held"]),
            picker=np.array(arrays["picker"], np.float32),
            frame=int(arrays["frame"]),
            calm=int(arrays["calm"]),
        )


NO_POINTS = np.empty((0, 2), np.int32)
PARKED = np.array([-1.0, -1.0, 1.0], np.float32)
"""Where the picker waits, out of reach of the cloth [m]."""


class Solver:
    """Moves one cloth. It keeps no state of its own: threads may share it.

    Args:
        cloth: Topology and rest shape.
        config: Constants.
    """

    def __init__(self, cloth: Cloth, config: SolverConfig | None = None):
        self.cloth = cloth
        self.config = config or SolverConfig()
        corners = np.repeat(np.arange(cloth.n_vertices, dtype=np.int32)[:, None], 2, 1)
        self._topology = Topology(
            cloth.faces,
            cloth.across,
            cloth.stretch,
            cloth.bend,
            np.concatenate([corners, cloth.edges]) if self.config.layers else NO_POINTS,
            cloth.areas,
            cloth.squares,
        )
        self._physics = _physics(self.config, float(cloth.rest_lengths.mean()))

    def rest(self, positions: ArrayLike) -> ClothState:
        """The cloth at the given positions (V,3) [m], not moving, the picker parked."""
        x = np.array(positions, np.float32, order="C")
        if x.shape != (self.cloth.n_vertices, 3) or not np.isfinite(x).all():
            raise ClothError(f"expected finite positions ({self.cloth.n_vertices}, 3), got {x.shape}")
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
        gravity: float | None = None,
        settle_speed: float | None = None,
    ) -> ClothState:
        """The cloth some frames of 0.01 s later.

        Advancing by a + b frames equals advancing by a, then by b, to the bit.

        Args:
            state: Where the cloth is now; not modified.
            frames: Number of frames, at most.
            picker_path: Picker position at the end of each frame (T,3) [m]; it stays where it is if not given.
            holding: Whether the picker is closed in each frame (T,); open if not given. A picker that is closed and
                empty grasps the nearest vertex within its reach at the start of the frame; a held vertex moves
                exactly as the picker does, but not into the table; an open picker holds nothing.
            gravity: Instead of the configured one [m/s²].
            settle_speed: Stop early once 99.5 % of the vertices stay below this speed [m/s].
        """
        path = np.broadcast_to(state.picker, (frames, 3)) if picker_path is None else np.asarray(picker_path)
        closed = np.zeros(frames, bool) if holding is None else np.asarray(holding, bool)
        if path.shape != (frames, 3) or closed.shape != (frames,):
            raise ClothError(f"expected a path ({frames}, 3) and holding ({frames},), got {path.shape}, {closed.shape}")
        if state.positions.shape != (self.cloth.n_vertices, 3):
            raise ClothError(f"expected {self.cloth.n_vertices} vertices, got {state.positions.shape}")
        now = state.copy()
        physics = self._physics._replace(settle_speed=np.float32(settle_speed or 0.0))
        if gravity is not None:
            physics = physics._replace(gravity=np.float32(gravity))
        done, now.held, now.calm = simulate(
            now.positions,
            now.velocities,
            now.picker,
            np.ascontiguousarray(path, np.float32),
            closed,
            now.held,
            now.calm,
            self._topology,
            physics,
        )
        now.frame += done
        return now


def _physics(config: SolverConfig, edge: float) -> Physics:
    """The constants for a mesh of the given mean edge length [m]."""
    step = FRAME_S / config.substeps
    constants = {
        "step": step,
        "gravity": config.gravity,
        "drag": config.drag,
        "top_speed": config.top_speed,
        "thickness": config.thickness,
        "table_friction": config.table_friction,
        "layer_friction": config.layer_friction,
        "push_out": config.push_out * step,
        "bend_compliance": config.bend_compliance * (edge / 0.012) ** 3 / step**2,
        "compression": config.compression,
        "spring_damping": config.spring_damping,
        "contact_damping": config.contact_damping,
        "settle_speed": 0.0,
        "cell": max(0.9 * edge, 2 * config.thickness),
        "least_margin": 0.001,
        "horizon": FRAME_S,
        "stray": 0.02,
        "most_margin": 0.002,
    }
    rounded = {name: np.float32(value) for name, value in constants.items()}
    return Physics(config.substeps, config.spring_passes, **rounded)
