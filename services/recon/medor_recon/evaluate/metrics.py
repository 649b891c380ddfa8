"""Measures of one reconstruction against the truth. Lengths in cm; canonical errors in units of the NOCS cube.

A garment that looks the same, or nearly so, after a turn about its body axis is compared with the truth turned in the
way that fits the predicted coordinates best; measures named `plain` allow for none.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from medor_cloth.coverage import coverage
from medor_cloth.intersection import self_intersections
from medor_cloth.nocs import NOCS
from medor_cloth.raster import rasterize
from medor_recon.canonical.symmetry import sides
from medor_recon.canonicalized import Canonicalized
from medor_recon.completed import Completed
from medor_recon.completion.turn import Turn, turns
from medor_recon.evaluate.observed import Observed

SAMPLES = 4000
"""Points that stand for a surface."""
CM = 100.0


def canonical_measures(seen: Canonicalized, observed: Observed) -> tuple[dict[str, float], Turn]:
    """Errors of the pixels' canonical coordinates, and the turn of the truth that fits them best.

    Returns:
        `canonical`, `canonical_plain`: mean over the pixels. `canonical_median`. `side_right`: 1 when the garment as
        it is, up to its true symmetry, fits best.
    """
    true, on_cloth = observed.true_nocs(seen.points)
    nocs, true = seen.nocs[on_cloth], true[on_cloth]
    errors = [np.linalg.norm(nocs - turn(true), axis=1) for turn in turns(seen.category)]
    best = int(np.argmin([error.mean() for error in errors]))
    measures = {
        "canonical": float(errors[best].mean()),
        "canonical_median": float(np.median(errors[best])),
        "canonical_plain": float(errors[0].mean()),
        "side_right": float(best % sides(seen.category) == 0),
    }
    return measures, turns(seen.category)[best]


def mesh_measures(
    completed: Completed, positions: NDArray[np.float32], seen: Canonicalized, observed: Observed, turn: Turn
) -> dict[str, float]:
    """All errors of a mesh on the table.

    Args:
        completed: its canonical coordinates and faces.
        positions: (V, 3) its vertices, world frame [m], finetuned or not.
        seen: what was seen of it.
        observed: the truth.
        turn: of the true shape, to the one the view was taken for.
    """
    return (
        vertex_measures(completed.canonical, positions, observed, turn)
        | view_measures(positions, completed.faces, seen)
        | surface_measures(positions, completed.faces, observed)
        | quality(completed, positions)
    )


def vertex_measures(
    canonical: NDArray[np.float32], positions: NDArray[np.float32], observed: Observed, turn: Turn
) -> dict[str, float]:
    """Distances of the true vertices to their partners: the vertices nearest in canonical space.

    Returns:
        `vertex`, `vertex_plain`: mean over all; `visible`, `hidden`: over those that the camera does, or does not,
        see in truth [cm].
    """
    box, tree = NOCS[observed.category], KDTree(canonical)
    plain = box.encode(observed.garment.vertices)

    def errors(nocs: NDArray[np.float32]) -> NDArray[np.float64]:
        return np.linalg.norm(positions[tree.query(box.decode(nocs))[1]] - observed.positions, axis=1) * CM

    error, visible = errors(turn(plain)), observed.visible
    return {
        "vertex": float(error.mean()),
        "visible": _mean(error[visible]),
        "hidden": _mean(error[~visible]),
        "vertex_plain": float(errors(plain).mean()),
    }


def view_measures(positions: NDArray[np.float32], faces: NDArray[np.int32], seen: Canonicalized) -> dict[str, float]:
    """How well the visible part of a mesh lies on what was seen.

    Returns:
        `view`: mean distance of the observed points to the nearest vertex of a face that the camera sees, the
        finetuning's chamfer; `view_surface`: to that part of the surface itself [cm].
    """
    raster = rasterize(positions, faces, seen.camera)
    if not raster.mask.any():
        return {"view": np.nan, "view_surface": np.nan}
    vertices = positions[np.unique(faces[raster.face[raster.mask]])]
    surface = seen.camera.back_project(raster.depth)[raster.mask]
    return {"view": _one_way(seen.points, vertices), "view_surface": _one_way(seen.points, surface)}


def surface_measures(positions: NDArray[np.float32], faces: NDArray[np.int32], observed: Observed) -> dict[str, float]:
    """Distances of the whole surfaces on the table, hidden layers included, and of their shadows.

    Returns:
        `chamfer`: mean of both ways; `to_true`: from the mesh to the true one; `from_true`: back [cm]. `coverage`:
        relative error of the area seen from above; `coverage_size`: without its sign.
    """
    rng = np.random.default_rng(0)
    found, true = spread(positions, faces, rng), spread(observed.positions, observed.garment.faces, rng)
    to_true, from_true = _one_way(found, true), _one_way(true, found)
    error = coverage(positions, faces) / coverage(observed.positions, observed.garment.faces) - 1
    return {
        "chamfer": (to_true + from_true) / 2,
        "to_true": to_true,
        "from_true": from_true,
        "coverage": error,
        "coverage_size": abs(error),
    }


def quality(completed: Completed, positions: NDArray[np.float32]) -> dict[str, float]:
    """How much like cloth a mesh is.

    Returns:
        `strain_5`, `strain_50`, `strain_95`: percentiles over the edges of their length on the table over that in
        canonical space, less 1; `crossings`: pairs of faces that run through each other, for each face.
    """
    faces = completed.faces
    edges = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    rest, now = (
        np.linalg.norm(at[edges[:, 1]].astype(np.float64) - at[edges[:, 0]], axis=1)
        for at in (completed.canonical, positions)
    )
    strain = np.percentile(now / np.maximum(rest, 1e-6) - 1, (5, 50, 95))
    names = ("strain_5", "strain_50", "strain_95")
    crossings = self_intersections(positions, faces) / len(faces)
    return dict(zip(names, strain.tolist(), strict=True)) | {"crossings": crossings}


def spread(vertices: NDArray[np.floating], faces: NDArray[np.integer], rng: np.random.Generator) -> NDArray:
    """Points (SAMPLES, 3) spread evenly over a surface."""
    corners = vertices[faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    face = rng.choice(len(area), SAMPLES, p=area / area.sum())
    u, v = rng.random((2, SAMPLES, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return corners[face, 0] * (1 - u - v) + corners[face, 1] * u + corners[face, 2] * v


def _one_way(points: NDArray[np.floating], others: NDArray[np.floating]) -> float:
    """Mean distance of points to the nearest of the others [cm]."""
    return float(np.mean(KDTree(others).query(points)[0])) * CM


def _mean(values: NDArray[np.floating]) -> float:
    return float(values.mean()) if len(values) else np.nan
