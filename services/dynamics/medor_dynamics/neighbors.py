"""Edges of a batch of graphs as its nodes lie now: those of the mesh, and collision edges between close nodes."""

import numpy as np
from numpy.typing import NDArray

from medor_cloth.kernel import kernel

NO_SLOT = -1
"""Slot of a collision edge."""


def edges_of(
    positions: NDArray[np.float32],
    starts: NDArray[np.int64],
    mesh_starts: NDArray[np.int64],
    mesh_senders: NDArray[np.int64],
    *,
    radius: float,
    nearest: int,
    close_mesh_edges: bool,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """All edges, sorted by receiver; the mesh edges of a receiver first.

    Args:
        positions: (N, 3) nodes of all graphs, one graph after the other [m].
        starts: (B + 1,) first node of each graph, and N.
        mesh_starts: (N + 1,) first mesh edge into each node, and their number M.
        mesh_senders: (M,) senders of the mesh edges.
        radius: of collision edges, inclusive [m].
        nearest: how many collision edges a node receives at most, 0 for all.
        close_mesh_edges: whether close neighbours in the mesh share collision edges too.

    Returns:
        (E,) senders, (E,) receivers and (E,) slots: the number of the mesh edge, or `NO_SLOT`.
    """
    args = (positions, starts, mesh_starts, mesh_senders, radius, nearest, close_mesh_edges)
    if nearest:
        room = len(mesh_senders) + nearest * len(positions)
    else:
        nothing = np.empty(0, np.int64)
        room = _wire(*args, nothing, nothing, nothing)
    senders, receivers, slots = (np.empty(room, np.int64) for _ in range(3))
    count = _wire(*args, senders, receivers, slots)
    return senders[:count], receivers[:count], slots[:count]


@kernel
def _wire(positions, starts, mesh_starts, mesh_senders, radius, nearest, close_mesh_edges, senders, receivers, slots):
    """Writes the edges and returns their number; only counts them where there is no room."""
    count = 0
    largest = np.max(starts[1:] - starts[:-1])
    found, distances = np.empty(largest, np.int64), np.empty(largest, np.float64)
    member_of = np.full(len(positions), -1, np.int64)
    for graph in range(len(starts) - 1):
        first, last = starts[graph], starts[graph + 1]
        low, columns, cell_starts, sorted_nodes = _grid(positions, first, last, radius)
        for node in range(first, last):
            for slot in range(mesh_starts[node], mesh_starts[node + 1]):
                if not close_mesh_edges:
                    member_of[mesh_senders[slot]] = node
                if len(senders):
                    senders[count], receivers[count], slots[count] = mesh_senders[slot], node, slot
                count += 1
            close = _near(
                positions, node, radius, nearest, low, columns, cell_starts, sorted_nodes, member_of, found, distances
            )
            if len(senders):
                for rank in range(close):
                    senders[count + rank], receivers[count + rank] = found[rank], node
                    slots[count + rank] = NO_SLOT
            count += close
    return count


@kernel
def _grid(positions, first, last, radius):
    """Square columns as wide as the radius, and the nodes of one graph sorted by column."""
    low = np.full(2, np.inf)
    high = np.full(2, -np.inf)
    for node in range(first, last):
        for axis in range(2):
            low[axis] = min(low[axis], positions[node, axis])
            high[axis] = max(high[axis], positions[node, axis])
    # Cloth that flew apart must not ask for memory without end: the columns become wider instead.
    side = max(radius, max(high[0] - low[0], high[1] - low[1]) / 256)
    columns = np.empty(2, np.int64)
    for axis in range(2):
        columns[axis] = int((high[axis] - low[axis]) / side) + 1
    cell_of = np.empty(last - first, np.int64)
    cell_starts = np.zeros(columns[0] * columns[1] + 1, np.int64)
    for node in range(first, last):
        cell = _column(positions[node, 0], low[0], side) * columns[1] + _column(positions[node, 1], low[1], side)
        cell_of[node - first] = cell
        cell_starts[cell + 1] += 1
    for cell in range(len(cell_starts) - 1):
        cell_starts[cell + 1] += cell_starts[cell]
    free = cell_starts.copy()
    sorted_nodes = np.empty(last - first, np.int64)
    for node in range(first, last):
        cell = cell_of[node - first]
        sorted_nodes[free[cell]] = node
        free[cell] += 1
    return np.array([low[0], low[1], side]), columns, cell_starts, sorted_nodes


@kernel
def _column(x, low, side):
    return int((x - low) / side)


@kernel
def _near(positions, node, radius, nearest, low, columns, cell_starts, sorted_nodes, member_of, found, distances):
    """Finds the nodes within the radius: the nearest ones in order of distance, or all. Returns their number."""
    count = 0
    column, row = _column(positions[node, 0], low[0], low[2]), _column(positions[node, 1], low[1], low[2])
    for x in range(max(column - 1, 0), min(column + 2, columns[0])):
        cells = x * columns[1]
        begin = cell_starts[cells + max(row - 1, 0)]
        end = cell_starts[cells + min(row + 2, columns[1])]
        for place in range(begin, end):
            other = sorted_nodes[place]
            if other == node or member_of[other] == node:
                continue
            square = 0.0
            for axis in range(3):
                apart = np.float64(positions[node, axis]) - np.float64(positions[other, axis])
                square += apart * apart
            if square <= radius * radius:
                count = _insert(other, square, count, nearest, found, distances)
    return count


@kernel
def _insert(other, square, count, nearest, found, distances):
    """Keeps the `nearest` best of all that were offered, in order; equally far ones in the order of their number."""
    if not nearest:
        found[count] = other
        return count + 1
    if count == nearest:
        if not _before(square, other, distances[count - 1], found[count - 1]):
            return count
        count -= 1
    rank = count
    while rank > 0 and _before(square, other, distances[rank - 1], found[rank - 1]):
        found[rank], distances[rank] = found[rank - 1], distances[rank - 1]
        rank -= 1
    found[rank], distances[rank] = other, square
    return count + 1


@kernel
def _before(square, other, than_square, than_other):
    return square < than_square or (square == than_square and other < than_other)
