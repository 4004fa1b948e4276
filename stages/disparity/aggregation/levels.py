"""Costs as whole numbers: sums of these are exact, so a result does not depend on how the image is cut."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.stage import StageError, require_shape

SCALE = 4
"""Levels of one unit of cost. Both kinds of volume store log-odds, so one scale and one set of penalties fit all."""
CAP = 40 * SCALE
"""Largest cost above the pixel's least, levels. Log-odds of trained networks differ by less than 40."""
NOT_JUDGED = 4 * SCALE
"""Cost above the pixel's least of a cell without a cost, levels: a guided volume has none where descriptors already saw
that the cell hardly wins."""
NO_COST = np.int16(np.iinfo(np.int16).max)
"""The least cost of a pixel that has none."""
_LARGEST = 1 << 14


@dataclass(frozen=True)
class Levels:
    """The costs of some rows of an image, in whole levels.

    Attributes:
        above: (y, x, d) int16 in [0, CAP]: cost above the pixel's least. A cell without a cost has ``NOT_JUDGED``; one
            whose right pixel is outside the image has the mean of the pixel's others, which speaks neither for nor
            against it; a pixel without any cost has 0 everywhere.
        least: (y, x) int16: the pixel's least cost; ``NO_COST`` if it has none.
        d_min: the disparity of index 0, px.
    """

    above: NDArray[np.int16]
    least: NDArray[np.int16]
    d_min: int


def levels_of(costs: NDArray[Any], d_min: int) -> Levels:
    """Return costs in whole levels, ``rint(SCALE * cost)`` less the pixel's least and at most ``CAP``.

    Args:
        costs: (y, x, d) float16 or float32, lower is better; NaN is a cell without a cost. float32 is rounded to
            float16 first, as a cached volume is. An infinite cost counts as ``CAP`` above the least, or as the least.
        d_min: the disparity of index 0, px.

    Raises:
        StageError: if ``costs`` has another dtype or shape.
    """
    require_shape("the cost volume", costs, 3)
    if costs.dtype not in (np.float16, np.float32):
        raise StageError(f"the cost volume has dtype {costs.dtype}, expected float16 or float32")
    with np.errstate(over="ignore"):  # what float16 cannot hold is infinite, and infinite is the largest level
        bits = np.ascontiguousarray(costs, np.float16).view(np.uint16)
    made = Levels(np.empty(costs.shape, np.int16), np.empty(costs.shape[:2], np.int16), d_min)
    _fill(bits, _LEVEL_OF_HALF, d_min, made.above, made.least)
    return made


def with_mean(above: NDArray[np.int16], sums: NDArray[np.uint16], paths: int) -> NDArray[np.int16]:
    """Return the costs of a second pass: each with the mean of its paths' costs added, above the pixel's least.

    Args:
        above: (y, x, d) costs of the first pass, in [0, CAP] levels.
        sums: (y, x, d) their sums over all paths.
        paths: how many paths were summed, a power of two.

    Returns:
        (y, x, d) int16 levels in [0, 2 * CAP]: the mean is rounded, a half up, and at most ``CAP``.
    """
    made = np.empty_like(above)
    _add_mean(above, sums, paths.bit_length() - 1, made)
    return made


@kernel
def _add_mean(above: NDArray[np.int16], sums: NDArray[np.uint16], shift: int, made: NDArray[np.int16]) -> None:
    """Write the costs of a second pass; every number is as narrow as the sums, so that many are computed at once."""
    height, width, depth = above.shape
    half, bits = np.uint16(1 << shift >> 1), np.uint16(shift)
    for y in range(height):
        for x in range(width):
            low = np.uint16(0xFFFF)
            for d in range(depth):
                low = min(low, sums[y, x, d])
            for d in range(depth):
                mean = np.uint16(np.uint16(np.uint16(sums[y, x, d] - low) + half) >> bits)
                made[y, x, d] = np.int16(above[y, x, d] + np.int16(min(mean, np.uint16(CAP))))


def _level_of_half() -> NDArray[np.int16]:
    """Return the level of each of the 65536 float16 numbers, by its bits."""
    values = np.arange(1 << 16, dtype=np.uint16).view(np.float16)
    numbers = np.where(np.isnan(values), np.float16(0), values).astype(np.float64)
    rounded = np.clip(np.rint(numbers * SCALE), -_LARGEST, _LARGEST)
    return np.where(np.isnan(values), NO_COST, rounded.astype(np.int16))


_LEVEL_OF_HALF = _level_of_half()


@kernel
def ends(x: int, width: int, d_min: int, depth: int) -> tuple[int, int]:
    """Return the first and the end index of the disparities whose right pixel, ``x - d``, is in the image."""
    return max(0, x - (width - 1) - d_min), min(depth, x - d_min + 1)


@kernel
def _fill(
    bits: NDArray[np.uint16],
    level: NDArray[np.int16],
    d_min: int,
    above: NDArray[np.int16],
    least: NDArray[np.int16],
) -> None:
    """Write the levels and the least of each pixel."""
    height, width, depth = bits.shape
    for y in range(height):
        for x in range(width):
            low = NO_COST
            for d in range(depth):
                above[y, x, d] = level[bits[y, x, d]]
                low = min(low, above[y, x, d])
            least[y, x] = low
            if low == NO_COST:
                above[y, x] = 0
                continue
            for d in range(depth):
                cost = np.int32(above[y, x, d]) - np.int32(low)  # the difference of two levels may not fit 16 bits
                above[y, x, d] = np.int16(NOT_JUDGED if above[y, x, d] == NO_COST else min(cost, np.int32(CAP)))
            first, end = ends(x, width, d_min, depth)
            if 0 < end - first < depth:
                _fill_outside(above[y, x], first, end)


@kernel
def _fill_outside(above: NDArray[np.int16], first: int, end: int) -> None:
    """Give the cells whose right pixel is outside the image the mean of the others."""
    count, total = end - first, 0
    for d in range(first, end):
        total += above[d]
    mean = np.int16((total + count // 2) // count)
    above[:first] = mean
    above[end:] = mean
