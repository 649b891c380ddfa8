"""Users' own garments: reading a mesh file and saying clearly why it cannot be cloth."""

import io
import math
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from medor_cloth.errors import GarmentError, MeshError
from medor_cloth.garment import CATEGORIES, SCALE, Garment
from medor_cloth.orientation import oriented
from medor_cloth.topology import topology

FILE_TYPES = ("obj", "ply", "glb")
VERTICES = (300, 4000)
"""Accepted numbers of vertices: a garment in the camera's view with edges of about 12 mm has 300–1900."""
EXTENT_M = (0.1, 0.6)
"""Accepted longest side of the bounding box; the camera sees 0.54 m of the table."""
USUAL_EXTENT_M = 0.32
SHORTEST_EDGE_M = 1e-4
UV_STRETCH = (0.8, 1.25)
"""Median ratio of panel to worn edge length within which texture coordinates are taken as panels in metres."""
UV_STRETCH_OF_MOST = (0.4, 2.5)
"""The same for the 5th and 95th percentile."""


def load_mesh(source: str | Path | bytes, category: str, file_type: str | None = None) -> Garment:
    """Read a garment from an OBJ, PLY or GLB file.

    The mesh must be one sheet of cloth in its worn pose: metres at the robot's scale, z up, front towards −y, one
    connected piece, at most two faces at an edge, with openings. Equal vertices are welded; the winding is repaired.
    Texture coordinates that are plainly metres become the panels; otherwise the worn shape is the cloth at rest.

    Args:
        source: path, or the file's content.
        category: one of `CATEGORIES`.
        file_type: "obj", "ply" or "glb"; needed with bytes, else taken from the path.

    Raises:
        MeshError: the file cannot be read or is not such a mesh; the message says what was found.
        GarmentError: unknown category.
    """
    if category not in CATEGORIES:
        raise GarmentError(f"unknown category {category!r}; expected one of {', '.join(CATEGORIES)}")
    mesh = _read(source, file_type)
    corners = np.asarray(mesh.faces, np.int64)
    vertices, faces = _welded(np.asarray(mesh.vertices, np.float64), corners)
    kept = (faces != np.roll(faces, 1, axis=1)).all(axis=1)  # welding collapses slivers
    faces = faces[kept]
    _check_size(vertices, faces, category)
    _check_sheet(faces, len(vertices))
    flipped = oriented(vertices, faces)
    uv = _panels(mesh, corners[kept], vertices, faces)
    centre = (vertices.max(axis=0) + vertices.min(axis=0)) / 2
    return Garment(
        category=category,
        seed=None,
        vertices=(vertices - centre).astype(np.float32),
        faces=_flip(faces, flipped).astype(np.int32),
        panel_uv=None if uv is None else _flip(uv, flipped).astype(np.float32),
    )


def _read(source: str | Path | bytes, file_type: str | None) -> trimesh.Trimesh:
    if file_type is None and not isinstance(source, bytes):
        file_type = Path(source).suffix
    kind = (file_type or "").lower().lstrip(".")
    if kind not in FILE_TYPES:
        raise MeshError(f"expected a file of type {', '.join(FILE_TYPES)}, got {kind or 'none'!r}")
    try:
        content = source if isinstance(source, bytes) else Path(source).read_bytes()
        scene = trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False, skip_materials=True)
        mesh = scene.to_mesh()
    except OSError as error:
        raise MeshError(f"cannot open the mesh file: {error}") from error
    except Exception as error:  # trimesh's readers raise whatever a broken file makes them trip over
        raise MeshError(f"not a readable {kind} file: {error}") from error
    if not len(mesh.faces):
        raise MeshError("the file holds no faces; a point cloud is not cloth")
    if not np.isfinite(mesh.vertices).all():
        raise MeshError("the file holds vertices that are not finite numbers")
    return mesh


def _welded(vertices: NDArray, faces: NDArray) -> tuple[NDArray, NDArray]:
    """Unite vertices of equal position (files split them at texture seams) and drop unused ones."""
    used, corner = np.unique(faces, return_inverse=True)
    places, vertex = np.unique(vertices[used], axis=0, return_inverse=True)
    return places, vertex.ravel()[corner].reshape(faces.shape)


def _check_size(vertices: NDArray, faces: NDArray, category: str) -> None:
    low, high = VERTICES
    if not low <= len(vertices) <= high:
        change = "subdivide" if len(vertices) < low else "simplify or remesh"
        raise MeshError(
            f"{len(vertices)} vertices; expected {low}–{high} (edges of about 12 mm): {change} the mesh first"
        )
    extent = float(np.ptp(vertices, axis=0).max())
    if not EXTENT_M[0] <= extent <= EXTENT_M[1]:
        raise MeshError(
            f"longest side {extent:.4g} m; expected {EXTENT_M[0]}–{EXTENT_M[1]} m, a garment in the camera's view"
            f"{_unit_hint(extent, category)}"
        )
    ends = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    shortest = float(np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1).min())
    if shortest < SHORTEST_EDGE_M:
        raise MeshError(f"an edge only {shortest:.1e} m long; merge vertices closer than {SHORTEST_EDGE_M} m")


def _unit_hint(extent: float, category: str) -> str:
    """Which common mistake of units explains the size best, if any."""
    scale = SCALE[category]
    mistakes = {
        "in millimetres": 1e-3,
        "in centimetres": 1e-2,
        f"full size in metres (the cell works at {scale} of full size)": scale,
        "full size in centimetres": scale * 1e-2,
        "full size in millimetres": scale * 1e-3,
    }
    name, factor = min(mistakes.items(), key=lambda m: abs(math.log(max(extent, 1e-12) * m[1] / USUAL_EXTENT_M)))
    if not EXTENT_M[0] <= extent * factor <= EXTENT_M[1]:
        return ""
    return f"; perhaps it is {name}: scale it by {factor:g}"


def _check_sheet(faces: NDArray, n_vertices: int) -> None:
    found = topology(faces, n_vertices)
    if found.nonmanifold_edges:
        raise MeshError(f"{found.nonmanifold_edges} edges with more than two faces; cloth is a single sheet")
    if found.pinched_vertices:
        raise MeshError(f"{found.pinched_vertices} vertices where rims touch; separate them or join the faces")
    if found.components > 1:
        raise MeshError(f"{found.components} separate pieces; expected one connected garment")
    if not found.boundary_loops:
        raise MeshError("a closed surface without any opening; a garment has a neck, cuffs, a waist or hems")


def _flip(corners: NDArray, flipped: NDArray) -> NDArray:
    """Reverse the corners (F, 3, …) of the flipped faces."""
    shape = (-1,) + (1,) * (corners.ndim - 1)
    return np.where(flipped.reshape(shape), corners[:, ::-1], corners)


def _panels(mesh: trimesh.Trimesh, corners: NDArray, vertices: NDArray, faces: NDArray) -> NDArray | None:
    """(F, 3, 2) texture coordinates if they are panels in metres."""
    uv = getattr(mesh.visual, "uv", None)
    if uv is None or not np.isfinite(uv).all():
        return None
    panels = np.asarray(uv, np.float64)[corners]
    flat = np.linalg.norm(np.roll(panels, -1, axis=1) - panels, axis=2)
    worn = np.linalg.norm(np.roll(vertices[faces], -1, axis=1) - vertices[faces], axis=2)
    few, median, most = np.percentile(flat / worn, (5, 50, 95))
    metric = UV_STRETCH[0] <= median <= UV_STRETCH[1]
    even = UV_STRETCH_OF_MOST[0] <= few and most <= UV_STRETCH_OF_MOST[1]
    return panels if metric and even and flat.min() >= SHORTEST_EDGE_M else None
