"""The median of the disparities around each pixel: it takes single outliers and noise below a pixel off a map."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel


def median(disparity: NDArray[np.float32], side: int) -> NDArray[np.float32]:
    """Return the median of the square window around each pixel, of those of its pixels that have a disparity.

    Where their number is even, the own disparity is kept if it lies between the two in the middle, else the nearer one
    is taken: no mean of two surfaces comes out. A pixel whose median would lead out of the other view keeps its own.

    Args:
        disparity: (y, x) float32, px; NaN: none.
        side: pixels of a side of the window, odd; 1 changes nothing.

    Returns:
        (y, x) float32, px; NaN exactly where ``disparity`` is.
    """
    made = np.empty_like(disparity)
    _median(disparity, side // 2, made)
    return made


@kernel
def _median(disparity: NDArray[np.float32], reach: int, made: NDArray[np.float32]) -> None:
    height, width = disparity.shape
    found = np.empty((2 * reach + 1) ** 2, np.float32)
    for y in range(height):
        top, bottom = max(0, y - reach), min(height, y + reach + 1)
        for x in range(width):
            own, count = disparity[y, x], 0
            for v in range(top, bottom):
                for u in range(max(0, x - reach), min(width, x + reach + 1)):
                    value = disparity[v, u]
                    if value == value:  # not NaN
                        at = count
                        while at > 0 and found[at - 1] > value:
                            found[at] = found[at - 1]
                            at -= 1
                        found[at] = value
                        count += 1
            if own == own:
                middle = min(max(own, found[(count - 1) // 2]), found[count // 2])
                made[y, x] = middle if 0 <= x - middle <= width - 1 else own
            else:
                made[y, x] = own
