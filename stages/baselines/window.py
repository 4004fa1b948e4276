"""Winner takes all over window costs, one disparity at a time: no volume is ever held.

Both views' winners are found in one pass, since a cost belongs to a left pixel and to the right pixel it is compared
with; where the two disagree, the disparity is dropped.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from semidense.stages.baselines.declaration import Matched
from semidense.stages.compute.kernel import kernel
from semidense.stages.disparity.right_view import agreeing

Planes = Callable[[int, slice, slice], NDArray[np.float32]]
"""``costs(d, left, right)``: float32 (y, column), the cost of each left column of a slice with its right column."""


def match_windows(costs: Planes, shape: tuple[int, int], disparities: range, window: int, tolerance: float) -> Matched:
    """Return the disparity of least mean cost, before and after the left-right check.

    Args:
        costs: the cost of single pixels at one disparity.
        shape: rows and columns of the image.
        disparities: px; of equal costs the first wins.
        window: side of the square over which costs are averaged, px, odd; it is cut where there is no cost.
        tolerance: largest difference between the two views' disparities that is kept, px.

    Returns:
        ``dense`` and ``disparity``: (y, x) float32, px; NaN where no right pixel lies in the image, and, in
        ``disparity``, where the right view's winner differs.
    """
    left, right = (np.full(shape, np.nan, np.float32) for _ in range(2))
    left_least, right_least = (np.full(shape, np.inf, np.float32) for _ in range(2))
    width = shape[1]
    for d in disparities:
        columns = slice(max(0, d), min(width, width + d))
        if columns.start >= columns.stop:
            continue
        seen = slice(columns.start - d, columns.stop - d)
        plane = box_mean(costs(d, columns, seen), window // 2)
        _keep_least(plane, d, left[:, columns], left_least[:, columns])
        _keep_least(plane, d, right[:, seen], right_least[:, seen])
    return {"dense": left, "disparity": agreeing(left, right, tolerance)}


def box_mean(values: NDArray[np.float32], radius: int) -> NDArray[np.float32]:
    """Return the mean over the square of side ``2 radius + 1`` around each value, cut at the array's border.

    Each sum is taken anew, so that a value does not depend on where its array was cut.
    """
    rows, result = np.empty_like(values), np.empty_like(values)
    _box(np.ascontiguousarray(values), radius, rows, result)
    return result


@kernel
def _box(values: NDArray[np.float32], radius: int, rows: NDArray[np.float32], result: NDArray[np.float32]) -> None:
    """Average over columns, then over rows."""
    height, width = values.shape
    for y in range(height):
        for x in range(width):
            first, last = max(0, x - radius), min(width, x + radius + 1)
            total = np.float32(0)
            for u in range(first, last):
                total += values[y, u]
            rows[y, x] = total / np.float32(last - first)
    for y in range(height):
        first, last = max(0, y - radius), min(height, y + radius + 1)
        for x in range(width):
            total = np.float32(0)
            for v in range(first, last):
                total += rows[v, x]
            result[y, x] = total / np.float32(last - first)


@kernel
def _keep_least(plane: NDArray[np.float32], d: int, winner: NDArray[np.float32], least: NDArray[np.float32]) -> None:
    """Write the disparity where its cost is below the least so far."""
    height, width = plane.shape
    for y in range(height):
        for x in range(width):
            if plane[y, x] < least[y, x]:
                least[y, x] = plane[y, x]
                winner[y, x] = d
