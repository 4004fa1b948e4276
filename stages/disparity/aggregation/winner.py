"""The disparity of least aggregated cost, among the cells whose right pixel is in the image."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.disparity.aggregation.levels import NO_COST, ends
from semidense.stages.disparity.aggregation.strips import Strip

NONE = -1
"""The index of a pixel that has no winner."""


def winner(strip: Strip) -> NDArray[np.int32]:
    """Return the index of the least aggregated cost of each pixel; of equal costs the smallest disparity wins.

    Only cells whose right pixel, ``x - d``, is in the image can win; one without a cost of its own (not judged in a
    guided volume) can, by its neighbours'.

    Returns:
        (y, x) int32 index on the last axis; ``NONE`` where a pixel has no such cell or no cost at all.
    """
    index = np.empty(strip.aggregated.shape[:2], np.int32)
    _least(strip.aggregated, strip.single.least, strip.single.d_min, index)
    return index


def v_fit(strip: Strip, index: NDArray[np.int32]) -> NDArray[np.float32]:
    """Return how far the tip of the V through the winner and its neighbours lies from it.

    Two lines of opposite slope meet at ``(S(d - 1) - S(d + 1)) / (2 (max(S(d - 1), S(d + 1)) - S(d)))``, where ``S``
    is the sum of the sums of both passes, or of the one: those of the second say better where a surface lies, those of
    the first by how much. Shimizu and Okutomi, 2001, name it the equiangular fit.

    Returns:
        (y, x) float32 in [-0.5, 0.5] px; 0 at an end of the range or of the image, and where the winner costs as much
        as both or more.
    """
    shift = np.zeros(index.shape, np.float32)
    _shift(strip.first, strip.aggregated, index, strip.single.d_min, shift)
    return shift


@kernel
def first_least(costs: NDArray[Any], x: int, first: int, end: int) -> int:
    """Return the index of the first least of a pixel's costs, from 0 to 65535; there must be one at least.

    The pixel is one of a row, (x, d): to cut it out would take as long as to look through it.
    """
    least = np.uint32(0xFFFFFFFF)
    for d in range(first, end):  # cost and index in one number: many are compared at once
        least = min(least, np.uint32(np.uint32(costs[x, d]) << np.uint32(16) | np.uint32(d)))
    return int(np.int64(least & np.uint32(0xFFFF)))


@kernel
def _least(aggregated: NDArray[np.uint16], least: NDArray[np.int16], d_min: int, index: NDArray[np.int32]) -> None:
    """Write the index of each pixel's winner."""
    height, width, depth = aggregated.shape
    for y in range(height):
        row = aggregated[y]
        for x in range(width):
            first, end = ends(x, width, d_min, depth)
            found = first < end and least[y, x] != NO_COST
            index[y, x] = first_least(row, x, first, end) if found else NONE


@kernel
def _shift(
    first: NDArray[np.uint16],
    second: NDArray[np.uint16],
    index: NDArray[np.int32],
    d_min: int,
    shift: NDArray[np.float32],
) -> None:
    """Write the shift of each pixel that has a winner with two neighbours."""
    height, width, depth = first.shape
    for y in range(height):
        for x in range(width):
            begin, end = ends(x, width, d_min, depth)
            d = index[y, x]
            if begin < d < end - 1:
                before = np.int64(first[y, x, d - 1]) + np.int64(second[y, x, d - 1])
                here = np.int64(first[y, x, d]) + np.int64(second[y, x, d])
                after = np.int64(first[y, x, d + 1]) + np.int64(second[y, x, d + 1])
                slope = max(before, after) - here
                if slope > 0:  # the winner of the second pass may not be the least of both
                    shift[y, x] = min(max((before - after) / (2 * slope), -0.5), 0.5)
