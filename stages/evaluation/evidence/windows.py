"""Means over square windows, each summed anew, so that a value does not depend on where its array was cut."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.evaluation.declaration import RADIUS


def window_mean(values: NDArray[np.float32], side: int) -> NDArray[np.float32]:
    """Return the mean of the known values in each window; the array is smaller by 50 px all round.

    Args:
        values: (y + 100, x + 100) float32; NaN: not known.
        side: of the window, px, odd, at most 101.

    Returns:
        (y, x) float32; NaN where nothing in the window is known.

    >>> block = np.full((101, 102), np.nan, np.float32)
    >>> block[50, 49:51] = 1, 3
    >>> window_mean(block, 3).tolist()
    [[2.0, 3.0]]
    """
    height, width = (length - 2 * RADIUS for length in values.shape)
    result = np.empty((height, width), np.float32)
    known = ~np.isnan(values)
    _write_mean(np.where(known, values, np.float32(0)), known.astype(np.int64), side // 2, result)
    return result


@kernel
def _write_mean(
    values: NDArray[np.float32], known: NDArray[np.int64], radius: int, result: NDArray[np.float32]
) -> None:
    """Sum over columns, then over rows."""
    height, width = result.shape
    sums = np.empty(values.shape[1], np.float64)
    counts = np.empty(values.shape[1], np.int64)
    for y in range(height):
        sums[:] = 0
        counts[:] = 0
        for row in range(y + RADIUS - radius, y + RADIUS + radius + 1):
            for x in range(len(sums)):
                sums[x] += values[row, x]
                counts[x] += known[row, x]
        for x in range(width):
            total, count = 0.0, 0
            for column in range(x + RADIUS - radius, x + RADIUS + radius + 1):
                total += sums[column]
                count += counts[column]
            result[y, x] = total / count if count else np.nan
