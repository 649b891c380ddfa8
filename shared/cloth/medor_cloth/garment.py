"""A garment: its worn shape, its cloth, and the generator that makes one from a seed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from medor_cloth.errors import GarmentError
from medor_cloth.inflate import inflate
from medor_cloth.intersection import self_intersections
from medor_cloth.layout import lay_flat
from medor_cloth.panels import PATTERNS
from medor_cloth.sewing import Sewn, sew
from medor_cloth.topology import topology
from medor_cloth.triangles import smallest_angle_deg

CATEGORIES = ("trousers", "tshirt", "dress", "skirt", "jumpsuit")

SYMMETRY_ORDER = {"trousers": 2, "tshirt": 1, "dress": 2, "skirt": 12, "jumpsuit": 2}
"""How many turns about the body axis leave a category alike (MEDOR, section III-C)."""

SCALE = {"trousers": 0.42, "tshirt": 0.36, "dress": 0.29, "skirt": 0.28, "jumpsuit": 0.28}
"""Size of the garments over that of an adult's, so that they fit the camera's view (MEDOR, appendix)."""

GENERATOR_VERSION = 1
"""Rises whenever the same seed gives another garment."""

ATTEMPTS = 12
MIN_ANGLE_DEG = 12.0
EDGE_RANGE_M = (0.004, 0.03)


@dataclass(frozen=True)
class Garment:
    """A garment's cloth in canonical space: worn pose, z up, x lateral, front = −y, metres."""

    category: str
    seed: int | None
    """The seed it was generated from; None for a user's mesh."""
    vertices: NDArray[np.float32]
    """(V, 3) canonical positions [m]."""
    faces: NDArray[np.int32]
    """(F, 3), wound outwards."""
    panel_uv: NDArray[np.float32] | None
    """(F, 3, 2) place of each face corner in its flat panel [m]: the cloth at rest. None: rest = `vertices`."""

    def laid_flat(self) -> NDArray[np.float32]:
        """The garment smoothed out on the table by hand, front up.

        Returns:
            (V, 3) task space [m], body up = world +y, centred on the origin; layers apart and none crossing.
        """
        return lay_flat(self.vertices, self.faces, self.panel_uv)


def generate(category: str, seed: int, edge_m: float = 0.012) -> Garment:
    """Generate one garment; the same arguments always give the same garment.

    Attempt k draws from `numpy.random.default_rng([category index, seed, k])`; a shape that does not sew into a clean
    sheet, or runs through itself, is dropped for the next attempt's.

    Args:
        category: one of CATEGORIES.
        seed: not negative; seeds below 800 000 are for training, 800 000–899 999 for tests.
        edge_m: mean edge length of the mesh [m].

    Raises:
        GarmentError: unknown category, edge length out of range, or no valid shape in `ATTEMPTS` attempts.
    """
    if category not in CATEGORIES:
        raise GarmentError(f"unknown category {category!r}; expected one of {', '.join(CATEGORIES)}")
    if seed < 0:
        raise GarmentError(f"a garment's seed must not be negative, got {seed}")
    if not EDGE_RANGE_M[0] <= edge_m <= EDGE_RANGE_M[1]:
        raise GarmentError(f"edge_m must lie in {EDGE_RANGE_M[0]}–{EDGE_RANGE_M[1]} m, got {edge_m}")
    flaws = []
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([CATEGORIES.index(category), seed, attempt])
        garment, flaw = _attempt(category, seed, edge_m, rng)
        if not flaw:
            return garment
        flaws.append(flaw)
    raise GarmentError(f"no valid {category} for seed {seed} at {edge_m} m edges: {', '.join(sorted(set(flaws)))}")


def _attempt(category: str, seed: int, edge_m: float, rng: np.random.Generator) -> tuple[Garment, str]:
    """One draw of the generator and what is wrong with it ("" when nothing is)."""
    scale = SCALE[category]
    pattern = PATTERNS[category](rng)
    sewn = sew(pattern, edge_m / scale, rng)
    worn = inflate(sewn, pattern) * scale
    garment = Garment(
        category=category,
        seed=seed,
        vertices=np.column_stack([worn[:, 0], -worn[:, 2], worn[:, 1]]).astype(np.float32),
        faces=sewn.vertex[sewn.faces].astype(np.int32),
        panel_uv=(sewn.points * scale)[sewn.faces].astype(np.float32),
    )
    return garment, _flaw(garment, sewn, pattern.boundary_loops)


def _flaw(garment: Garment, sewn: Sewn, loops: int) -> str:
    if not topology(garment.faces, len(garment.vertices)).is_sphere_with_holes(loops):
        return "not a clean sheet"
    if smallest_angle_deg(sewn.points[sewn.faces]) < MIN_ANGLE_DEG:
        return "needle triangles"
    if self_intersections(garment.vertices, garment.faces):
        return "self-intersection"
    return ""
