"""What the costs say of each pixel: whether one disparity stands out, or many would do as well."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.disparity.aggregation.levels import CAP, SCALE, ends
from semidense.stages.disparity.aggregation.strips import Strip
from semidense.stages.disparity.aggregation.winner import NONE, first_least

FEATURES = (
    "aggregated_margin",
    "single_margin",
    "single_excess",
    "single_cost",
    "left_right",
    "agrees",
    "aggregated_flatness",
    "single_flatness",
    "single_minima",
)
"""The order of the feature axis.

- ``aggregated_margin``: how far the least aggregated cost beyond ±1 px of the winner lies above it, cost a path.
- ``single_margin``: the same of the single costs and their own winner, at most 40.
- ``single_excess``: single cost at the winner above the pixel's least, at most 40.
- ``single_cost``: single cost at the winner.
- ``left_right``: difference to the disparity that the aggregated costs give the right pixel, px.
- ``agrees``: 1 if the single costs' own winner is within 1 px, else 0.
- ``aggregated_flatness``, ``single_flatness``: share of the disparities that cost at most ``NEAR`` more than the least.
- ``single_minima``: how many minima of the single costs lie at most ``NEAR`` above the least.

Costs are log-odds of a mismatch."""
NEAR = 1.0
"""Disparities whose cost is within this of the least are as good as the best, log-odds."""


def evidence(strip: Strip, winner: NDArray[np.int32], paths: int) -> NDArray[np.float32]:
    """Return what single and aggregated costs say of each pixel.

    Only cells whose right pixel is in the image count. A margin is at most 40, and is 40 where no cell is a rival.

    Args:
        strip: rows of the aggregated volume, with their single costs.
        winner: (y, x) int32 index of the winner, ``NONE`` for none.
        paths: how many paths were summed.

    Returns:
        (feature, y, x) float32, see ``FEATURES``; NaN where there is no winner.
    """
    single, aggregated, d_min = strip.single, strip.aggregated, strip.single.d_min
    made = np.full((len(FEATURES), *winner.shape), np.nan, np.float32)
    right = np.empty(winner.shape[1], np.uint32)
    for y in range(len(winner)):
        _right_winner(aggregated[y], d_min, right)
        _evidence(single.above[y], single.least[y], aggregated[y], winner[y], right, d_min, paths, made[:, y])
    return made


@kernel
def _right_winner(aggregated: NDArray[np.uint16], d_min: int, right: NDArray[np.uint32]) -> None:
    """Write the index of the least cost of each right pixel of a row; of equal costs the smallest disparity's.

    Of a right pixel that no left one meets, something is written that is no index.
    """
    width, depth = aggregated.shape
    right[:] = np.uint32(0xFFFFFFFF)
    for x in range(width):
        first, end = ends(x, width, d_min, depth)
        for d in range(first, end):  # cost and index in one number: many are compared at once
            met = np.uint32(np.uint32(aggregated[x, d]) << np.uint32(16) | np.uint32(d))
            right[x - d_min - d] = min(right[x - d_min - d], met)
    for x in range(width):
        right[x] &= np.uint32(0xFFFF)


@kernel
def _evidence(
    single: NDArray[np.int16],
    least: NDArray[np.int16],
    aggregated: NDArray[np.uint16],
    winner: NDArray[np.int32],
    right: NDArray[np.uint32],
    d_min: int,
    paths: int,
    made: NDArray[np.float32],
) -> None:
    """Write the features of one row."""
    width, depth = single.shape
    level, level_sum = np.int16(NEAR * SCALE), np.uint16(NEAR * SCALE * paths)
    for x in range(width):
        best = winner[x]
        if best == NONE:
            continue
        first, end = ends(x, width, d_min, depth)
        alone = first_least(single, x, first, end)
        low, low_sum = single[x, alone], aggregated[x, best]
        rival, near = _others(single, x, alone, np.int16(low + CAP), np.int16(low + level), first, end)
        limits = np.uint16(low_sum + paths * CAP), np.uint16(low_sum + level_sum)
        rival_sum, near_sum = _others(aggregated, x, best, limits[0], limits[1], first, end)
        made[0, x] = (np.int64(rival_sum) - np.int64(low_sum)) / (paths * SCALE)
        made[1, x] = (np.int64(rival) - np.int64(low)) / SCALE
        made[2, x] = single[x, best] / SCALE
        made[3, x] = (np.int64(single[x, best]) + np.int64(least[x])) / SCALE
        made[4, x] = abs(best - np.int64(right[x - best - d_min]))
        made[5, x] = abs(alone - best) <= 1
        made[6, x] = near_sum / (end - first)
        made[7, x] = near / (end - first)
        made[8, x] = _minima(single, x, np.int16(low + level), first, end, near)


@kernel
def _others(
    costs: NDArray[Any],
    x: int,
    best: int,
    most: Any,  # noqa: ANN401 - either integer type
    near: Any,  # noqa: ANN401
    first: int,
    end: int,
) -> tuple[int, int]:
    """Return the least of a pixel's costs that is not beside its best, at most ``most``; how many are at most ``near``.

    Every number is as narrow as the costs, so that many are compared at once.
    """
    rival, count = most, np.uint16(0)
    for d in range(first, end):
        count = np.uint16(count + np.uint16(costs[x, d] <= near))
        rival = min(rival, costs[x, d] if np.uint16(d - best + 1) > np.uint16(2) else most)
    return int(np.int64(rival)), int(np.int64(count))


@kernel
def _minima(costs: NDArray[np.int16], x: int, most: np.int16, first: int, end: int, near: int) -> int:
    """Return how many local minima of a pixel cost at most ``most``, as ``near`` costs do; a plateau is one minimum.

    Each is counted where it ends.
    """
    count, d = 0, first
    while near > 0:
        if costs[x, d] <= most:
            near -= 1
            if d == end - 1 or costs[x, d + 1] > costs[x, d]:
                begin = d
                while begin > first and costs[x, begin - 1] == costs[x, d]:
                    begin -= 1
                count += begin == first or costs[x, begin - 1] > costs[x, d]
        d += 1
    return count
