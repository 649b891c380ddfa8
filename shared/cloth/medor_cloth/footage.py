"""Cloth to look at, from wherever it is kept: mesh files, saved states and rollouts, data sets, the generator."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from numpy.typing import NDArray

from medor_cloth.errors import ClothError, DatasetError, MeshError
from medor_cloth.garment import Garment, generate
from medor_cloth.goals import flattened, solver_of
from medor_cloth.start import dropped, picked

MESHES = (".obj", ".ply", ".glb", ".stl", ".off")
STATES = (".npz", ".npy")
Start = Literal["worn", "flat", "drop", "picks"]
STARTS: tuple[Start, ...] = ("worn", "flat", "drop", "picks")


@dataclass(frozen=True)
class Footage:
    """One state of a cloth, or several one after the other.

    Attributes:
        name: What it is, for a caption and a file name.
        states: (T, V, 3) float32 positions [m].
        faces: (F, 3) int32.
        seconds: Time between two states [s]; 0 where they are no motion.
        moves: (T, 2, 3) pick and place to draw on each state [m], NaN where there is none.
        worn: In canonical space, hanging in the air; else on the table z = 0.
    """

    name: str
    states: NDArray[np.float32]
    faces: NDArray[np.int32]
    seconds: float = 0.0
    moves: NDArray[np.float32] | None = None
    worn: bool = False

    def __post_init__(self) -> None:
        if self.states.ndim != 3 or self.states.shape[2] != 3 or not self.states.size:
            raise MeshError(f"{self.name}: expected positions (V,3) or (T,V,3), got {self.states.shape}")
        if not np.isfinite(self.states).all():
            raise MeshError(f"{self.name}: positions that are not finite numbers")
        faces, vertices = self.faces, self.states.shape[1]
        if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces) or faces.dtype.kind not in "iu":
            raise MeshError(f"{self.name}: expected faces (F,3) of whole numbers, got {faces.dtype} {faces.shape}")
        if faces.min() < 0 or faces.max() >= vertices:
            raise MeshError(f"{self.name}: faces name vertices {faces.min()}…{faces.max()}, there are {vertices}")

    @property
    def summary(self) -> str:
        """How large it is, for people."""
        count, vertices = self.states.shape[:2]
        return f"{count} state{'s' * (count > 1)}, {vertices} vertices, {len(self.faces)} faces"

    def caption(self, number: int) -> str:
        """What stands below the picture of a state: which one of how many, and when."""
        count = len(self.states)
        when = f"  {number * self.seconds:.2f} s" if self.seconds else ""
        return self.name if count == 1 else f"{self.name}  {number + 1}/{count}{when}"


def load(path: Path, index: int = 0, garment: Garment | None = None) -> Footage:
    """What a path holds: a mesh, a saved state or rollout, or the trajectory at an index of a data set.

    Args:
        path: A mesh file, `.npz` with `positions` (V,3) or (T,V,3) and `faces`, `.npy` of positions, or the folder of
            a data set.
        index: Of a trajectory.
        garment: Whose faces a saved state without faces has.

    Raises:
        ClothError: nothing there, or nothing that can be shown; the message says what is needed.
    """
    kind = path.suffix.lower()
    if not path.exists():
        raise ClothError(f"{path} does not exist")
    if path.is_dir():
        return _of_dataset(path, index)
    if kind in MESHES:
        return _of_mesh(path)
    if kind in STATES:
        return _of_arrays(path, garment)
    raise ClothError(
        f"cannot show {path.name}: expected a mesh ({', '.join(MESHES)}), saved states ({', '.join(STATES)}) or the "
        "folder of a data set"
    )


def of_garment(category: str, seed: int, start: Start, edge_m: float = 0.012) -> Footage:
    """A generated garment as it is worn, pressed flat, dropped or pulled about; chance follows from its seed."""
    garment = generate(category, seed, edge_m)
    name = f"{category} {seed} {start}"
    if start == "worn":
        return Footage(name, garment.vertices[None], garment.faces, worn=True)
    solver, rng = solver_of(garment), np.random.default_rng(seed)
    state = flattened(garment, solver)
    if start != "flat":
        state = (dropped if start == "drop" else picked)(solver, state, rng)
    return Footage(name, state.positions[None], garment.faces)


def _of_mesh(path: Path) -> Footage:
    try:
        mesh = trimesh.load_scene(path, process=False, skip_materials=True).to_mesh()
    except Exception as error:  # trimesh's readers raise whatever a broken file makes them trip over
        raise MeshError(f"{path.name} is not a readable {path.suffix} file: {error}") from error
    vertices = np.asarray(mesh.vertices, np.float32)
    below = len(vertices) > 0 and vertices[:, 2].min() < -0.01  # nothing lies on the table inside it
    return Footage(path.stem, vertices[None], np.asarray(mesh.faces, np.int32), worn=bool(below))


def _of_arrays(path: Path, garment: Garment | None) -> Footage:
    try:
        file = np.load(path)
        arrays = {"positions": file} if isinstance(file, np.ndarray) else dict(file)
    except (ValueError, OSError, EOFError) as error:
        raise ClothError(f"{path.name} is not a readable {path.suffix} file: {error}") from error
    found = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
    if "positions" not in arrays:
        raise ClothError(f"{path.name}: expected an array `positions`, got {found or 'nothing'}")
    if "faces" not in arrays:
        if garment is None:
            raise ClothError(f"{path.name} holds no `faces` but {found}; name the garment with --category and --seed")
        arrays["faces"] = garment.faces
    positions = arrays["positions"].astype(np.float32)
    return Footage(path.stem, positions[None] if positions.ndim == 2 else positions, arrays["faces"])


def _of_dataset(folder: Path, index: int) -> Footage:
    try:
        from medor_cloth.dataset import FRAMES_PER_STEP, Dataset
    except ImportError as error:
        raise ClothError("reading data sets needs the extra: pip install 'medor-cloth[data]'") from error
    dataset = Dataset(folder)
    if not 0 <= index < len(dataset):
        raise DatasetError(f"expected --index from 0 to {len(dataset) - 1}, got {index}")
    trajectory = dataset[index]
    name = f"{dataset.kind} {trajectory.garment.category} {trajectory.id}"
    states, faces = trajectory["positions"], trajectory.garment["faces"]
    if dataset.kind == "recon":  # the move after a state is what people ask for
        moves = np.concatenate([trajectory["moves"][1:], np.full((1, 2, 3), np.nan, np.float32)])
        return Footage(name, states, faces, moves=moves)
    moves = np.repeat(trajectory["move"][None], len(states), 0)
    return Footage(name, states, faces, FRAMES_PER_STEP * 0.01, moves)
