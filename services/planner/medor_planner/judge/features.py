"""What the judge is told of each candidate: lengths [m], areas as shares of the flat garment, cosines.

None depends on where on the table the garment lies or which way it is turned.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from medor_cloth.alignment import align_in_plane, canonical_cost, moved_in_plane
from medor_cloth.coverage import coverages
from medor_planner.judge.relief import CELL_M, Relief
from medor_planner.judge.situation import Foreseen, Situation
from medor_planner.sampling import ABOVE
from medor_wire.messages import Category, ClothMesh, GoalSet

CATEGORIES: tuple[Category, ...] = ("trousers", "tshirt", "dress", "skirt", "jumpsuit")
ALONG_M = (-0.12, -0.09, -0.06, -0.03, 0.03, 0.06, 0.09, 0.12, 0.16)
"""Where heights are read on the line of the pull, from the pick [m]."""
ASIDE_M = ((-0.05, -0.04), (0.05, -0.04), (-0.05, 0.04), (0.05, 0.04))
"""And beside it: along, aside [m]."""
AROUND_M = 0.012
"""Vertices so near to the pick, seen from above, are layers of it [m]."""
PATCH = 30
"""Vertices nearest to the pick in canonical space that should go the same way."""
MOVED_M = 0.02
"""A vertex that goes farther has moved [m]."""

Columns = Mapping[str, NDArray | np.floating | float]


def features(situation: Situation) -> tuple[tuple[str, ...], NDArray[np.float32]]:
    """Names (F) and values (K, F) of what is known of K candidates.

    Raises:
        NoGarment: no pixel of the view shows cloth.
    """
    relief = Relief.of(situation.view, situation.camera)
    columns: dict[str, NDArray | np.floating | float] = {}
    for part in _parts(situation, relief):
        columns |= part
    count = len(situation.candidates)
    values = np.stack([np.broadcast_to(column, count) for column in columns.values()], axis=1)
    return tuple(columns), values.astype(np.float32)


def _parts(situation: Situation, relief: Relief) -> Iterator[Columns]:
    picks, places = situation.candidates.picks.astype(np.float64), situation.candidates.places.astype(np.float64)
    length = np.linalg.norm((places - picks)[:, :2], axis=1)
    heading = (places - picks)[:, :2] / np.maximum(length, 1e-6)[:, None]
    yield _garment(situation, relief)
    yield _pull(situation, relief, picks, places, heading)
    yield _on_the_way(relief, picks, heading)
    yield _in_the_mesh(situation, picks, places, heading)
    for name, one in situation.foreseen.items():
        yield {f"{name} {key}": column for key, column in _foreseen(situation, relief, one).items()}


def _garment(situation: Situation, relief: Relief) -> Columns:
    """What is the same for all candidates."""
    heights, mesh = relief.heights[relief.heights > 0], situation.mesh
    rows, columns = np.nonzero(relief.heights)
    return {
        **{f"is_{category}": float(mesh.category == category) for category in CATEGORIES},
        "covered": relief.area_m2 / situation.goals.flat_coverage_m2,
        "flat": situation.goals.flat_coverage_m2,
        "height_mean": heights.mean(),
        "height_95": np.quantile(heights, 0.95),
        "height_max": heights.max(),
        "rim": relief.rim_m,
        "extent": np.hypot(rows.std(), columns.std()) * CELL_M,
        "visible": mesh.visible.mean(),
        "confidence_mean": _confidence(mesh).mean(),
    }


def _pull(situation: Situation, relief: Relief, picks: NDArray, places: NDArray, heading: NDArray) -> Columns:
    """Where the pull begins and ends."""
    middle = np.median(situation.mesh.vertices[situation.mesh.visible], axis=0)
    away = picks[:, :2] - middle[:2]
    distance = np.linalg.norm(away, axis=1)
    outward = np.sum(away * heading, axis=1)
    return {
        "length": np.linalg.norm((places - picks)[:, :2], axis=1),
        "length_3d": np.linalg.norm(places - picks, axis=1),
        "rise": places[:, 2] - picks[:, 2],
        "pick_height": picks[:, 2],
        "place_height": places[:, 2],
        "pick_inside": relief.at(relief.inside, picks[:, :2]),
        "pick_outside": relief.at(relief.outside, picks[:, :2]),
        "place_inside": relief.at(relief.inside, places[:, :2]),
        "place_outside": relief.at(relief.outside, places[:, :2]),
        "from_middle": distance,
        "outward": outward,
        "outward_cos": outward / np.maximum(distance, 1e-6),
    }


def _on_the_way(relief: Relief, picks: NDArray, heading: NDArray) -> Columns:
    """Heights before, behind and beside the pick."""
    aside = np.stack([-heading[:, 1], heading[:, 0]], axis=1)
    points = {f"height_{1e3 * at:.0f}": at * heading for at in ALONG_M}
    points |= {f"height_{1e3 * at:.0f}_{1e3 * by:.0f}": at * heading + by * aside for at, by in ASIDE_M}
    return {name: relief.at(relief.heights, picks[:, :2] + offset) for name, offset in points.items()}


def _in_the_mesh(situation: Situation, picks: NDArray, places: NDArray, heading: NDArray) -> Columns:
    """What is believed of the picked vertex: layers, place in the garment, and the way it would have to go."""
    mesh, goals = situation.mesh, situation.goals
    vertices, canonical, place = mesh.vertices.astype(np.float64), _canonical(mesh), worn(mesh)
    picked = KDTree(vertices).query(picks - ABOVE)[1]
    layers = KDTree(vertices[:, :2]).query_ball_point(vertices[picked, :2], AROUND_M, return_length=True)
    of_one = len(vertices) / (2 * goals.flat_coverage_m2) * np.pi * AROUND_M**2
    way = ways(mesh, goals)
    patch = KDTree(canonical).query(canonical[picked], k=min(PATCH, len(canonical)))[1]
    left, together = way[picked], way[patch].mean(axis=1)
    done = np.zeros_like(left)
    done[:, :2] = (places - picks)[:, :2]
    along = np.sum(left[:, :2] * heading, axis=1)
    return {
        "confidence": _confidence(mesh)[picked],
        "layers": layers / of_one,
        "worn_height": place[picked, 2],
        "worn_side": np.abs(place[picked, 0]),
        "worn_radius": np.linalg.norm(canonical[picked] - canonical.mean(axis=0), axis=1),
        "patch_spread": vertices[patch].std(axis=1).sum(axis=1),
        "goal_distance": np.linalg.norm(left, axis=1),
        "goal_along": along,
        "goal_cos": along / np.maximum(np.linalg.norm(left[:, :2], axis=1), 1e-6),
        "goal_nearer": np.linalg.norm(left, axis=1) - np.linalg.norm(left - done, axis=1),
        "patch_goal_along": np.sum(together[:, :2] * heading, axis=1),
        "patch_goal_distance": np.linalg.norm(together, axis=1),
    }


def _foreseen(situation: Situation, relief: Relief, one: Foreseen) -> Columns:
    """What one model says will come."""
    flat, camera = situation.goals.flat_coverage_m2, situation.camera
    positions = np.where(np.isfinite(one.positions).all(axis=(1, 2), keepdims=True), one.positions, one.positions[:1])
    area = coverages(positions, one.mesh.faces, threads=1)
    cost = canonical_cost(positions, situation.goals.goals)
    moved = np.linalg.norm(positions[1:] - positions[:1], axis=-1)
    spread = np.linalg.norm(positions[..., :2].std(axis=1), axis=1)
    return {
        "gain": np.clip((area[1:] - area[0]) / flat, -2, 2),
        "over_seen": np.clip((area[1:] - relief.area_m2) / flat, -2, 2),
        "unmoved_over_seen": np.clip((area[0] - relief.area_m2) / flat, -2, 2),
        "nearer": cost[0] - cost[1:],
        "unmoved_cost": cost[0],
        "moved_mean": moved.mean(axis=1),
        "moved_share": (moved > MOVED_M).mean(axis=1),
        "lost": 1 - camera.contains(positions[1:]).mean(axis=1),
        "height": positions[1:, :, 2].mean(axis=1),
        "spread": spread[1:] - spread[0],
    }


def ways(mesh: ClothMesh, goals: GoalSet) -> NDArray[np.float64]:
    """(V, 3) from each vertex to its place in the nearest goal, brought to the garment in the plane [m]."""
    vertices = mesh.vertices.astype(np.float64)
    poses = goals.goals.astype(np.float64)
    found = [moved_in_plane(pose, *align_in_plane(pose, vertices)) - vertices for pose in poses]
    return min(found, key=lambda way: float(np.linalg.norm(way, axis=1).mean()))


def worn(mesh: ClothMesh) -> NDArray[np.float64]:
    """(V, 3) places in the garment as it is worn, from its middle, over its extent along each axis."""
    canonical = _canonical(mesh)
    return (canonical - canonical.mean(axis=0)) / np.maximum(np.ptp(canonical, axis=0), 1e-6)


def _canonical(mesh: ClothMesh) -> NDArray[np.float64]:
    return (mesh.vertices if mesh.canonical is None else mesh.canonical).astype(np.float64)


def _confidence(mesh: ClothMesh) -> NDArray[np.float32]:
    return np.ones(len(mesh.vertices), np.float32) if mesh.confidence is None else mesh.confidence


def mirrored(names: Sequence[str]) -> NDArray[np.int64]:
    """(F,) which feature takes the place of which when pulls are seen in a mirror along them."""
    aside = {f"height_{1e3 * at:.0f}_{1e3 * by:.0f}": f"height_{1e3 * at:.0f}_{-1e3 * by:.0f}" for at, by in ASIDE_M}
    return np.array([names.index(aside.get(name, name)) for name in names])
