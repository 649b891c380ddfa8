"""A decision as the judge meets it: what was seen, what was believed, and what models foresaw of each candidate."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self, cast

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import Camera
from medor_planner.sampling import Candidates
from medor_wire.messages import CameraInfo, Category, ClothMesh, DepthView, GoalSet

DEPTH_UNIT_M = 1e-4
"""Of stored depth [m]."""


@dataclass(frozen=True, eq=False)
class Foreseen:
    """What one model foresees on one mesh.

    Attributes:
        mesh: before the action.
        positions: (K + 1, V, 3) final vertices [m]; the first are those of doing nothing.
    """

    mesh: ClothMesh
    positions: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Situation:
    """One decision among K candidates.

    Attributes:
        view: what the camera saw.
        mesh: on which picks were chosen.
        candidates: K of them.
        goals: of the mesh's canonical pose; all meshes share it.
        foreseen: by the name of the opinion.
    """

    view: DepthView
    mesh: ClothMesh
    candidates: Candidates
    goals: GoalSet
    foreseen: Mapping[str, Foreseen]

    def among(self, chosen: NDArray[np.bool_]) -> Self:
        """The same decision among some of the candidates (K,)."""
        kept = np.concatenate([[True], chosen])
        foreseen = {name: Foreseen(one.mesh, one.positions[kept]) for name, one in self.foreseen.items()}
        return replace(self, candidates=self.candidates.where(chosen), foreseen=foreseen)

    def hearing(self, more: Mapping[str, Foreseen]) -> Self:
        """The same decision, when more opinions are known."""
        return replace(self, foreseen={**self.foreseen, **more})

    def heard(self, names: Iterable[str]) -> Self:
        """The same decision, when only some opinions are known."""
        return replace(self, foreseen={name: self.foreseen[name] for name in names})

    @property
    def camera(self) -> Camera:
        info = self.view.camera
        return Camera(info.K, info.T_world_camera, info.width, info.height)

    def arrays(self) -> dict[str, NDArray]:
        """To be stored: depth in tenths of a millimetre, foreseen positions as float16."""
        mesh, camera, mask = self.mesh, self.view.camera, self.view.mask
        found = {
            "category": np.array(mesh.category),
            "depth": np.round(self.view.depth / DEPTH_UNIT_M).astype(np.uint16),
            "K": camera.K,
            "T_world_camera": camera.T_world_camera,
            "picks": self.candidates.picks,
            "places": self.candidates.places,
            "goals": self.goals.goals.astype(np.float16),
            "flat_coverage_m2": np.array(self.goals.flat_coverage_m2),
            "faces": mesh.faces,
            "canonical": mesh.canonical,
            "confidence": mesh.confidence,
            "vertices": mesh.vertices,
            "visible": mesh.visible,
        }
        if mask is not None:
            found["mask"] = mask
        for name, one in self.foreseen.items():
            found[f"vertices {name}"], found[f"visible {name}"] = one.mesh.vertices, one.mesh.visible
            found[f"positions {name}"] = one.positions.astype(np.float16)
        return {name: array for name, array in found.items() if array is not None}

    @classmethod
    def restored(cls, arrays: dict[str, NDArray]) -> Self:
        """From what `arrays` gave."""
        category = cast(Category, str(arrays["category"]))
        depth = (arrays["depth"] * DEPTH_UNIT_M).astype(np.float32)
        height, width = depth.shape
        camera = CameraInfo(K=arrays["K"], T_world_camera=arrays["T_world_camera"], width=width, height=height)
        shared = {"faces": arrays["faces"], "category": category, "canonical": arrays["canonical"]}
        shared["confidence"] = arrays.get("confidence")

        def mesh(name: str) -> ClothMesh:
            return ClothMesh(vertices=arrays[f"vertices{name}"], visible=arrays[f"visible{name}"], **shared)

        names = [key.removeprefix("positions") for key in arrays if key.startswith("positions ")]
        return cls(
            DepthView(depth=depth, mask=arrays.get("mask"), camera=camera),
            mesh(""),
            Candidates(arrays["picks"], arrays["places"]),
            GoalSet(goals=arrays["goals"].astype(np.float32), flat_coverage_m2=float(arrays["flat_coverage_m2"])),
            {name[1:]: Foreseen(mesh(name), arrays[f"positions{name}"].astype(np.float32)) for name in names},
        )


@dataclass(frozen=True, eq=False)
class Outcomes:
    """What K candidates did, in the simulator, and where the garment was before.

    Attributes:
        coverage_m2, cost_m, in_view: (K + 1,) coverage, canonical cost and share of the vertices in the picture; the
            first before the action.
        flat_coverage_m2: of the true garment.
        seed: of the garment.
    """

    coverage_m2: NDArray[np.float64]
    cost_m: NDArray[np.float64]
    in_view: NDArray[np.float64]
    flat_coverage_m2: float
    seed: int


DECISIONS, GLANCES = "decisions", "glances"
"""Folders below the one of a collection."""


def save(path: Path, situation: Situation, outcomes: Outcomes) -> None:
    """Write both to one file, at once."""
    part = path.with_suffix(".part")
    with part.open("wb") as file:
        np.savez_compressed(file, **situation.arrays(), **{f"true_{k}": v for k, v in vars(outcomes).items()})
    part.replace(path)


def load(path: Path) -> tuple[Situation, Outcomes]:
    """What `save` wrote."""
    with np.load(path) as file:
        arrays = dict(file)
    true = {name[5:]: arrays.pop(name) for name in list(arrays) if name.startswith("true_")}
    scalars = {"flat_coverage_m2": float(true.pop("flat_coverage_m2")), "seed": int(true.pop("seed"))}
    return Situation.restored(arrays), Outcomes(**true, **scalars)
