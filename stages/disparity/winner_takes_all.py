"""The disparity of least cost: winner takes all, and its optional sub-pixel refinement."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.disparity.declaration import DisparityParams
from semidense.stages.stage import Array, DisparityMap, OfVolume, StageError, require_shape

NONE = np.int16(np.iinfo(np.int16).max)
"""The rank of an invalid cost: above every number's, infinity included."""


def winner_take_all(costs: NDArray[Any], d_min: int) -> NDArray[np.float32]:
    """Return the disparity of least cost of each pixel.

    ``D(y, x) = argmin_d C(y, x, d)`` over the valid d; of equal costs the smallest d wins.

    Args:
        costs: (y, x, d) float16 or float32, lower is better; NaN is an invalid cell. Plus infinity is valid.
        d_min: the disparity of index 0, px; it may be negative.

    Returns:
        (y, x) float32, px, whole numbers in ``[d_min, d_min + D - 1]``; NaN where no d is valid.

    Raises:
        StageError: if ``costs`` has another dtype or shape, or no disparity.
    """
    _require_costs(costs)
    index = np.empty(costs.shape[:2], np.int32)
    costs = np.ascontiguousarray(costs)
    if costs.dtype == np.float16:
        _least_half(costs.view(np.uint16), index)
    else:
        _least(costs, index)
    return np.where(index < 0, np.float32(np.nan), (index + d_min).astype(np.float32))


def refine_subpixel(costs: NDArray[Any], disparity: NDArray[np.float32], d_min: int) -> NDArray[np.float32]:
    """Move each disparity to the lowest point of the parabola through its cost and the two beside it.

    ``d + (C(d - 1) - C(d + 1)) / (2 (C(d - 1) - 2 C(d) + C(d + 1)))``. A disparity stays as it is at an end of the
    range, beside an invalid or infinite cost, and where the three costs do not bend upwards.

    Args:
        costs: (y, x, d) float16 or float32, NaN invalid.
        disparity: (y, x) float32, px, as ``winner_take_all`` gives it for these costs; NaN stays NaN.
        d_min: the disparity of index 0, px.

    Returns:
        (y, x) float32, px, at most 0.5 px from ``disparity``.

    Raises:
        StageError: if the shapes differ or a disparity is not one of the volume's.
    """
    _require_costs(costs)
    index = _indices(costs, disparity, d_min)
    inner = np.nonzero((index > 0) & (index < costs.shape[2] - 1))
    before, here, after = (costs[*inner, index[inner] + step].astype(np.float64) for step in (-1, 0, 1))
    refined = disparity.astype(np.float32)
    refined[inner] += _shift(before, here, after).astype(np.float32)
    return refined


def _shift(before: Array, here: Array, after: Array) -> Array:
    """Return where the parabola is lowest, within ±0.5, 0 where there is no such place."""
    with np.errstate(invalid="ignore"):  # infinite costs give NaN, which the next line sees as not bent
        bend = before - 2 * here + after
        bent = (bend > 0) & np.isfinite(bend)
        half_slope = (before - after) / 2
    shift: Array = np.zeros_like(bend)
    np.divide(half_slope, bend, out=shift, where=bent)
    return np.clip(shift, -0.5, 0.5, out=shift)


def _indices(costs: Array, disparity: Array, d_min: int) -> NDArray[np.int64]:
    """Return the index of each disparity on the volume's last axis, -1 for NaN."""
    if disparity.shape != costs.shape[:2]:
        raise StageError(f"disparity has shape {disparity.shape}, the cost volume {costs.shape}: y and x must agree")
    index = disparity.astype(np.float64) - d_min
    valid = ~np.isnan(index)
    index[~valid] = -1
    outside = valid & ((index < 0) | (index >= costs.shape[2]) | (index != np.rint(index)))
    if outside.any():
        first = disparity[outside][0]
        raise StageError(f"disparity {first:g} px is none of the volume's {d_min} to {d_min + costs.shape[2] - 1} px")
    return index.astype(np.int64)


def _require_costs(costs: Array) -> None:
    require_shape("the cost volume", costs, 3)
    if costs.dtype not in (np.float16, np.float32):
        raise StageError(f"the cost volume has dtype {costs.dtype}, expected float16 or float32")
    if costs.shape[2] == 0:
        raise StageError(f"the cost volume has shape {costs.shape}: there is no disparity to choose from")


@kernel
def _least(costs: NDArray[np.float32], index: NDArray[np.int32]) -> None:
    """Write the index of the first least cost, -1 where all are NaN."""
    height, width, depth = costs.shape
    for y in range(height):
        for x in range(width):
            best, least = -1, np.float32(np.inf)
            for d in range(depth):
                cost = costs[y, x, d]
                if cost < least or (best < 0 and cost == least):  # the first infinite cost counts too
                    best, least = d, cost
            index[y, x] = best


@kernel
def _least_half(bits: NDArray[np.uint16], index: NDArray[np.int32]) -> None:
    """Do the same for float16, seen as its bits: integers that sort as the numbers do are compared many at once."""
    height, width, depth = bits.shape
    for y in range(height):
        for x in range(width):
            least = NONE
            for d in range(depth):
                least = min(least, _order(bits[y, x, d]))
            best = -1
            if least < NONE:
                best = 0
                while _order(bits[y, x, best]) != least:
                    best += 1
            index[y, x] = best


@kernel
def _order(bits: np.uint16) -> np.int16:
    """Return an integer that sorts as the float16 does: -0 as +0, NaN after everything."""
    size = np.int16(bits & 0x7FFF)
    if size > 0x7C00:
        return NONE
    return np.int16(-size) if bits & 0x8000 else size


def compute_disparity(params: DisparityParams, inputs: OfVolume) -> DisparityMap:
    """Compute the product ``disparity``; see ``winner_take_all`` and ``refine_subpixel``.

    Raises:
        StageError: if the volume and its coordinate ``d`` do not fit together.
    """
    costs = inputs["costvolume"]["cost"]
    range_ = inputs["costvolume"]["d"]
    if costs.ndim != 3 or range_.shape != costs.shape[2:]:
        raise StageError(f"the cost volume has shape {costs.shape}, its coordinate d {range_.shape}: they must agree")
    d_min = int(range_[0]) if range_.size else 0
    disparity = winner_take_all(costs, d_min)
    return {"disparity": refine_subpixel(costs, disparity, d_min) if params.subpixel else disparity}
