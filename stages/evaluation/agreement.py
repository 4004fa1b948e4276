"""Disparity agreement: how much of the map around a pixel says the same.

Disparities that are right lie on surfaces and agree with their neighbours; wrong ones scatter. The evaluation-Net
sees that only roughly, after poolings; counted exactly, it weighs in beside the network's answer.
"""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.stage import StageError, require_shape

TOLERANCE = 1.0
"""Largest difference of two disparities that agree, px: what counts as right elsewhere, too."""


def agreement(disparity: NDArray[np.float32], window: int) -> NDArray[np.float32]:
    """Return the share of a window's pixels whose disparity is within 1 px of the centre's.

    Args:
        disparity: (y, x) float32, px; NaN, where there is none, agrees with nothing.
        window: side of the square window, px, odd, at most 101.

    Returns:
        (y, x) float32 in [1 / window^2, 1]: a pixel agrees with itself. Beyond the image lies the nearest pixel.

    Raises:
        StageError: if the window is even or too large.

    Source: the feature "disparity agreement" of Poggi & Mattoccia, "Learning a general-purpose confidence measure based
    on O(1) features and a smarter aggregation strategy for semi global matching", 3DV 2016.

    >>> agreement(np.float32([[5, 5, 9, 5]]), window=3).tolist()
    [[1.0, 0.6666666865348816, 0.3333333432674408, 0.6666666865348816]]
    """
    require_shape("disparity", disparity, 2)
    return padded_agreement(np.pad(disparity, RADIUS, mode="edge"), window)


def padded_agreement(disparity: NDArray[np.float32], window: int) -> NDArray[np.float32]:
    """As ``agreement``, for a map (y + 100, x + 100) that brings 50 px of context on every side."""
    if window % 2 == 0 or not 1 <= window <= 2 * RADIUS + 1:
        raise StageError(f"the window of the agreement is {window} px, expected an odd number of at most 101")
    height, width = (length - 2 * RADIUS for length in disparity.shape)
    agreeing = np.empty((height, width), np.int32)
    _count_agreeing(np.ascontiguousarray(disparity), window // 2, agreeing)
    return (agreeing / np.float64(window**2)).astype(np.float32)


@kernel
def _count_agreeing(disparity: NDArray[np.float32], radius: int, agreeing: NDArray[np.int32]) -> None:
    """Count in each pixel's window those that agree with it, and the pixel itself.

    A row of centres at a time is compared with the pixels that lie equally far from them.
    """
    height, width = agreeing.shape
    tolerance = np.float32(TOLERANCE)
    for y in range(height):
        own, count = disparity[y + RADIUS, RADIUS : RADIUS + width], agreeing[y]
        count[:] = 0
        for row in range(y + RADIUS - radius, y + RADIUS + radius + 1):
            for first in range(RADIUS - radius, RADIUS + radius + 1):
                others = disparity[row, first : first + width]
                for x in range(width):
                    count[x] += np.int32(abs(others[x] - own[x]) <= tolerance)
        for x in range(width):
            count[x] = max(count[x], np.int32(1))
