"""A dense map for those who must have one: holes take the background's disparity."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.disparity.declaration import Filled, OfRefined
from semidense.stages.stage import NoParams, require_shape


def fill_holes(disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Fill every hole along its row with the smaller of the disparities at its two ends.

    What the right view does not see lies beside a nearer surface and belongs to the farther one, hence the smaller. A
    hole at the border takes the one end it has; a row without any disparity takes that of the nearest row that has
    some, of two the upper one.

    Args:
        disparity: (y, x) float32, px; NaN is a hole.

    Returns:
        (y, x) float32 without NaN, or all NaN if the map has no disparity at all. What was known stays as it was.

    Source: the background interpolation of the KITTI stereo development kit (Geiger et al., CVPR 2012), with the
    nearest row for rows without any.

    >>> N = np.nan
    >>> fill_holes(np.float32([[N, 5, N, N, 3], [N, N, N, N, N]])).tolist()
    [[5.0, 5.0, 3.0, 3.0, 3.0], [5.0, 5.0, 3.0, 3.0, 3.0]]
    """
    require_shape("disparity", disparity, 2)
    rows = fill_rows(disparity)
    known = np.nonzero(~np.isnan(rows).any(axis=1))[0]
    if known.size == 0:
        return disparity.copy()
    filled: NDArray[np.float32] = rows[_nearest(known, np.arange(len(rows)))]
    return filled


def fill_rows(disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a map, (y, x), whose holes have the smaller of the disparities at their two ends; NaN in empty rows."""
    before, after = _carried(disparity), _carried(disparity[:, ::-1])[:, ::-1]
    return np.where(np.isnan(disparity), np.fmin(before, after), disparity)


def _nearest(known: NDArray[np.intp], wanted: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the nearest of some sorted numbers to each number; of two the smaller."""
    after = np.searchsorted(known, wanted).clip(max=len(known) - 1)
    before = (after - 1).clip(min=0)
    nearest: NDArray[np.intp] = np.where(
        wanted - known[before] <= np.abs(known[after] - wanted), known[before], known[after]
    )
    return nearest


def _carried(disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the last disparity at or before each pixel of its row, NaN where there is none."""
    columns = np.where(np.isnan(disparity), -1, np.arange(disparity.shape[1]))
    last = np.maximum.accumulate(columns, axis=1)
    carried = np.take_along_axis(disparity, np.maximum(last, 0), axis=1)
    return np.where(last < 0, np.float32(np.nan), carried)


def compute_filled(_: NoParams, inputs: OfRefined) -> Filled:
    """Compute the product ``filled``; see ``fill_holes``."""
    disparity = inputs["refined"]["disparity"]
    filled = fill_holes(disparity)
    return {"disparity": filled, "guessed": np.isnan(disparity) & ~np.isnan(filled)}
