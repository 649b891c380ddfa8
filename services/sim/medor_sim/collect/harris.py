"""Harris corners of a cloth's silhouette: where a hand would take hold of it (MEDOR, section 5.1)."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, correlate1d, uniform_filter

BLOCK_PX = 5
K = 0.01
THRESHOLD = 0.2
"""Responses below this share of the largest are no corners."""
DILATION_PX = 7
_SMOOTH, _DERIVE = np.array([1.0, 4, 6, 4, 1]), np.array([-1.0, -2, 0, 2, 1])
"""The Sobel operator of aperture 5."""


def harris_response(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Corner response (H, W) of a mask: det M − k·(tr M)², M summed over a block; its scale means nothing."""
    image = mask.astype(np.float64)
    across, down = _sobel(image, 1), _sobel(image, 0)
    xx, yy, xy = (uniform_filter(product, BLOCK_PX, mode="mirror") for product in (across**2, down**2, across * down))
    return xx * yy - xy**2 - K * (xx + yy) ** 2


def harris_corners(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels (H, W) of a mask about its corners."""
    response = harris_response(mask)
    corners = response > THRESHOLD * response.max()
    return np.logical_and(binary_dilation(corners, np.ones((DILATION_PX, DILATION_PX))), mask)


def _sobel(image: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    return correlate1d(correlate1d(image, _DERIVE, axis, mode="mirror"), _SMOOTH, 1 - axis, mode="mirror")
