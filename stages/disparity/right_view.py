"""The right view's disparities, and whether they agree with the left view's."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.disparity.winner_takes_all import winner_take_all
from semidense.stages.stage import DisparityMap, NoParams, OfVolume, StageError, require_shape


def right_costs(costs: NDArray[Any], d_min: int) -> NDArray[Any]:
    """Return the right view's cost volume: the same costs, seen from there.

    ``C_right(y, x, d) = C(y, x + d, d)``: both volumes compare the same pairs of pixels, so nothing is computed anew.

    Args:
        costs: (y, x, d) float of the left view, NaN invalid.
        d_min: the disparity of index 0, px.

    Returns:
        (y, x, d) of the same dtype; NaN where the left pixel is outside the image.

    >>> right_costs(np.array([[[1, 2], [3, 4]]], np.float32), 0).tolist()
    [[[1.0, 4.0], [3.0, nan]]]
    """
    require_shape("the cost volume", costs, 3)
    width = costs.shape[1]
    right = np.full_like(costs, np.nan)
    for index in range(costs.shape[2]):
        disparity = index + d_min
        first, end = max(0, -disparity), min(width, width - disparity)
        if first < end:
            right[:, first:end, index] = costs[:, first + disparity : end + disparity, index]
    return right


def agreeing(disparity: NDArray[np.float32], right: NDArray[np.float32], tolerance: float = 1.0) -> NDArray[np.float32]:
    """Keep the disparities that the right view's map confirms.

    ``|D(y, x) - D_right(y, x - D(y, x))| <= tolerance``, the right map being read at the nearest column.

    Args:
        disparity: (y, x) float32, left view, px; NaN unknown.
        right: (y, x) float32, right view, px; NaN unknown.
        tolerance: px.

    Returns:
        (y, x) float32; NaN where the maps differ by more, the right one has none, or ``x - D`` lies outside
        [0, width - 1].

    Raises:
        StageError: if the shapes differ.

    >>> agreeing(np.float32([[9, 1, 2]]), np.float32([[1, 5, 5]]))
    array([[nan,  1., nan]], dtype=float32)
    """
    if disparity.shape != right.shape:
        raise StageError(f"left disparity has shape {disparity.shape}, right {right.shape}: they must be equal")
    rows, columns = np.nonzero(np.isfinite(disparity))
    own = disparity[rows, columns]
    landing = (columns - own).astype(np.float32)
    inside = (landing >= 0) & (landing <= right.shape[1] - 1)
    rows, columns, own, landing = (each[inside] for each in (rows, columns, own, landing))
    confirmed = np.abs(own - right[rows, np.rint(landing).astype(np.intp)]) <= tolerance  # NaN confirms nothing
    kept = np.full_like(disparity, np.nan)
    kept[rows[confirmed], columns[confirmed]] = own[confirmed]
    return kept


def compute_right_disparity(_: NoParams, inputs: OfVolume) -> DisparityMap:
    """Compute the product ``right_disparity``: winner takes all in ``right_costs``."""
    costs = inputs["costvolume"]["cost"]
    d_min = int(inputs["costvolume"]["d"][0])
    return {"disparity": winner_take_all(right_costs(costs, d_min), d_min)}
