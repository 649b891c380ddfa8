"""Adam (Kingma & Ba 2015) for one array."""

import numpy as np
from numpy.typing import NDArray

MOMENTUM, SPREAD, EPSILON = 0.9, 0.999, 1e-8


class Adam:
    """Turns the gradients of successive iterations into steps; starts without momentum."""

    def __init__(self, shape: tuple[int, ...], learning_rate: float) -> None:
        self._rate = learning_rate
        self._mean, self._square = np.zeros(shape), np.zeros(shape)
        self._count = 0

    def step(self, gradient: NDArray[np.float64]) -> NDArray[np.float64]:
        """What to add to the array; exactly 0 where no gradient has been different from 0."""
        self._count += 1
        self._mean += (1 - MOMENTUM) * (gradient - self._mean)
        self._square += (1 - SPREAD) * (gradient**2 - self._square)
        mean = self._mean / (1 - MOMENTUM**self._count)
        square = self._square / (1 - SPREAD**self._count)
        return -self._rate * mean / (np.sqrt(square) + EPSILON)
