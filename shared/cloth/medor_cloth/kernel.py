"""How the solver's inner loops are compiled."""

from numba import njit

kernel = njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
"""Compiles a function to machine code that runs without the interpreter lock.

Sums are not reordered, products not fused and roots not approximated: which of a loop's vector and scalar versions
runs depends on where its arrays happen to lie in memory, and both must give the same bits.

Compiled code is cached by the file it is written in: after a change to one kernel, touch the files of its callers.
"""
