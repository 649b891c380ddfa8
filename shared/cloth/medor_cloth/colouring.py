"""Colours for constraints, so that those of one colour touch no common vertex and can be solved side by side."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True)
def colour(pairs: NDArray[np.int32], n_vertices: int) -> NDArray[np.int64]:
    """Greedy edge colouring.

    Args:
        pairs: Vertices of each constraint (E,2); at most 31 constraints at one vertex.
        n_vertices: Number of vertices.

    Returns:
        Colour of each constraint (E,); constraints of one colour share no vertex.
    """
    taken = np.zeros(n_vertices, np.int64)
    colours = np.empty(len(pairs), np.int64)
    for e in range(len(pairs)):
        used = taken[pairs[e, 0]] | taken[pairs[e, 1]]
        c = 0
        while (used >> c) & 1:
            c += 1
        colours[e] = c
        taken[pairs[e, 0]] |= 1 << c
        taken[pairs[e, 1]] |= 1 << c
    return colours
