"""Garments of the training set as shapes to choose from: the canonical mesh without a network.

A library holds the medoids of a category's training garments. The one whose surface lies nearest to the observed
canonical points is taken, one way only: nothing is known of what is hidden.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import KDTree

from medor_cloth.nocs import NOCS, STORED
from medor_recon.completion.pixels import Pixels

POINTS = 400
"""Observed points compared with every template."""
FARTHEST = 0.1
"""Distance in the NOCS cube beyond which a point is an outlier and counts no more."""


@dataclass(frozen=True, eq=False)
class Templates:
    """T garments of one category, one after the other.

    Attributes:
        category: of all of them.
        seeds: (T,) int64 of the garments.
        nocs: (V of all, 3) float32 vertices in the NOCS cube, to 10 µm.
        faces: (F of all, 3) int32 into the vertices of their own garment.
        first_vertex, first_face: (T + 1,) int64 where each garment begins.
    """

    category: str
    seeds: NDArray[np.int64]
    nocs: NDArray[np.float32]
    faces: NDArray[np.int32]
    first_vertex: NDArray[np.int64]
    first_face: NDArray[np.int64]

    @classmethod
    def of(
        cls,
        category: str,
        seeds: Sequence[int],
        nocs: Sequence[NDArray[np.floating]],
        faces: Sequence[NDArray[np.integer]],
    ) -> "Templates":
        """A library of meshes, each vertices (V, 3) in the NOCS cube and faces (F, 3)."""
        vertices = STORED.load(STORED.store(np.concatenate(nocs)))
        first_vertex = np.cumsum([0, *map(len, nocs)])
        first_face = np.cumsum([0, *map(len, faces)])
        return cls(
            category, np.array(seeds), vertices, np.concatenate(faces).astype(np.int32), first_vertex, first_face
        )

    def __len__(self) -> int:
        return len(self.seeds)

    def __getitem__(self, index: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Vertices (V, 3) in the NOCS cube and faces (F, 3) of one template."""
        vertices = slice(self.first_vertex[index], self.first_vertex[index + 1])
        faces = slice(self.first_face[index], self.first_face[index + 1])
        return self.nocs[vertices], self.faces[faces]

    def nearest(self, pixels: Pixels) -> int:
        """The template that the observed canonical points lie nearest to, the surer the more."""
        spread = np.linspace(0, len(pixels.nocs) - 1, min(POINTS, len(pixels.nocs))).round().astype(int)
        distances = one_way(pixels.nocs[spread], self.nocs, self.first_vertex)
        weights = pixels.confidence[spread].mean(axis=1)
        return int((np.minimum(distances, FARTHEST) @ weights).argmin())

    def canonical(self, index: int) -> NDArray[np.float32]:
        """Vertices (V, 3) of one template, canonical space [m]."""
        return NOCS[self.category].decode(self[index][0])

    def to_bytes(self) -> bytes:
        """A compressed file: vertices as levels, faces as differences along the list, which repeat."""
        faces = np.diff(self.faces.ravel(), prepend=0).astype(np.int16)
        sizes = {"vertices": np.diff(self.first_vertex), "faces": np.diff(self.first_face)}
        packed = BytesIO()
        np.savez_compressed(
            packed,
            category=np.array(self.category),
            seeds=self.seeds,
            nocs=STORED.store(self.nocs),
            face_steps=faces,
            n_vertices=sizes["vertices"],
            n_faces=sizes["faces"],
        )
        return packed.getvalue()

    @classmethod
    def from_bytes(cls, packed: bytes) -> "Templates":
        """The library of such a file."""
        with np.load(BytesIO(packed)) as file:
            faces = np.cumsum(file["face_steps"], dtype=np.int32).reshape(-1, 3)
            starts = [np.concatenate([[0], np.cumsum(file[name])]) for name in ("n_vertices", "n_faces")]
            return cls(str(file["category"]), file["seeds"], STORED.load(file["nocs"]), faces, *starts)


def medoids(nocs: Sequence[NDArray[np.floating]], number: int) -> list[int]:
    """Indices of the shapes that stand for all: each next one lowers the mean distance to the nearest medoid most.

    Args:
        nocs: vertices (V, 3) of each shape.
        number: of medoids; all shapes if there are not more.
    """
    if len(nocs) <= number:
        return list(range(len(nocs)))
    between = chamfer_matrix(nocs)
    chosen: list[int] = []
    nearest = np.full(len(nocs), np.inf)
    for _ in range(number):
        chosen.append(int(np.minimum(nearest[:, None], between).sum(axis=0).argmin()))
        nearest = np.minimum(nearest, between[:, chosen[-1]])
    return chosen


def chamfer_matrix(nocs: Sequence[NDArray[np.floating]]) -> NDArray[np.float64]:
    """(T, T) mean distance of two shapes' vertices to each other's nearest, both ways."""
    trees = [KDTree(shape) for shape in nocs]
    one_way_means = np.array([[tree.query(shape)[0].mean() for tree in trees] for shape in nocs])
    return (one_way_means + one_way_means.T) / 2


@njit(cache=True, nogil=True, fastmath=True)
def one_way(points, vertices, first):
    """Distance (T, P) from each point (P, 3) to the nearest vertex of each template."""
    nearest = np.empty((len(first) - 1, len(points)), np.float32)
    for t in range(len(first) - 1):
        own = vertices[first[t] : first[t + 1]]
        for p in range(len(points)):
            x, y, z = points[p, 0], points[p, 1], points[p, 2]
            least = np.float32(np.inf)
            for v in range(len(own)):
                dx, dy, dz = own[v, 0] - x, own[v, 1] - y, own[v, 2] - z
                least = min(least, dx * dx + dy * dy + dz * dz)
            nearest[t, p] = np.sqrt(least)
    return nearest
