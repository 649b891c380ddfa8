"""Distance of a cloth to its canonical goals, whatever the place and heading on the table.

Turning and shifting in the table plane is free (MEDOR, section V): the cloth is fitted to every goal of the
garment's symmetry set by a rotation about z and a shift in x, y before distances are measured. Mirroring is not
a turn and never happens; heights stay as they are.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

ICP_ROUNDS = 5
ICP_HEADINGS = 12
ICP_LAST_ROUNDS = 10


def align_in_plane(source: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation about z and shift in the plane that bring `source` nearest to `target` (Kabsch, closed form).

    Args:
        source: (..., N, 3) or (..., N, 2) points in correspondence with `target` [m]; leading axes broadcast.
        target: (..., N, 3) or (..., N, 2) [m].

    Returns:
        R (..., 2, 2) and t (..., 2) [m], float64, with `target_xy ≈ source_xy @ R.T + t` in least squares.
    """
    source_xy, target_xy = (np.asarray(p, np.float64)[..., :2] for p in (source, target))
    source_mean, target_mean = source_xy.mean(axis=-2), target_xy.mean(axis=-2)
    s, t = source_xy - source_mean[..., None, :], target_xy - target_mean[..., None, :]
    along = np.einsum("...ni,...ni->...", s, t)
    across = np.einsum("...n,...n->...", s[..., 0], t[..., 1]) - np.einsum("...n,...n->...", s[..., 1], t[..., 0])
    R = rotation(np.arctan2(across, along))
    return R, target_mean - np.einsum("...ij,...j->...i", R, source_mean)


def rotation(angle: np.ndarray) -> np.ndarray:
    """(..., 2, 2) rotations by angles (...) [rad], counter-clockwise."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


def moved_in_plane(points: np.ndarray, R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Points (..., N, 3) turned by R (..., 2, 2) and shifted by t (..., 2) in the plane, heights kept; float64."""
    points = np.asarray(points, np.float64)
    xy = points[..., :2] @ np.swapaxes(R, -1, -2) + t[..., None, :]
    z = np.broadcast_to(points[..., 2:], (*xy.shape[:-1], 1))
    return np.concatenate([xy, z], axis=-1)


def canonical_cost(positions: np.ndarray, goals: np.ndarray, *, squared: bool = False) -> np.ndarray:
    """Mean distance of corresponding vertices to the nearest goal after the best fit in the plane [m].

    Args:
        positions: (..., V, 3) world frame [m].
        goals: (S, V, 3), the goals of the symmetry set, world frame [m].
        squared: mean squared distance [m²] instead, the form printed in the paper.

    Returns:
        (...) float64.
    """
    costs = []
    for goal in goals:
        offset = np.asarray(positions, np.float64) - moved_in_plane(goal, *align_in_plane(goal, positions))
        square = np.einsum("...i,...i->...", offset, offset)
        costs.append((square if squared else np.sqrt(square)).mean(axis=-1))
    return np.min(costs, axis=0)


def canonical_cost_unmatched(points: np.ndarray, goals: np.ndarray, *, headings: int = ICP_HEADINGS) -> float:
    """Mean distance from points to the nearest goal when there is no correspondence [m].

    Five rounds of nearest neighbour (every point looks for its nearest goal point) and the same fit (MEDOR, the
    baselines' cost). The fit is local, so it starts from several headings and the best is carried on.

    Args:
        points: (N, 3) world frame [m].
        goals: (S, G, 3) world frame [m]; G and N need not be equal.
        headings: starts of the fit, evenly spread over the full turn; the time grows with them.
    """
    points = np.asarray(points, np.float64)
    return min(_icp_cost(points, np.asarray(goal, np.float64), headings) for goal in goals)


def _icp_cost(points: np.ndarray, goal: np.ndarray, headings: int) -> float:
    # Moving the points instead of the goal leaves every distance as it is and needs one search tree only.
    tree = KDTree(goal)
    R = rotation(np.arange(headings) * (2 * np.pi / headings))
    t = goal[:, :2].mean(axis=0) - R @ points[:, :2].mean(axis=0)
    R, t, costs = _icp(points, goal, tree, R, t, ICP_ROUNDS)
    best = costs.argmin()
    _, _, refined = _icp(points, goal, tree, R[best], t[best], ICP_LAST_ROUNDS)
    return float(min(costs[best], refined))


def _icp(points: np.ndarray, goal: np.ndarray, tree: KDTree, R: np.ndarray, t: np.ndarray, rounds: int):
    for _ in range(rounds):
        _, nearest = tree.query(moved_in_plane(points, R, t))
        R, t = align_in_plane(points, goal[nearest])
    distance, _ = tree.query(moved_in_plane(points, R, t))
    return R, t, distance.mean(axis=-1)
