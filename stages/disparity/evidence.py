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

    Only cells whose right pixel is in the image count. With fewer than two minima a margin is 40, the largest.

    Args:
        strip: rows of the aggregated volume, with their single costs.
        winner: (y, x) int32 index of the winner, ``NONE`` for none.
        paths: how many paths were summed.

    Returns:
        (feature, y, x) float32, see ``FEATURES``; NaN where there is no winner.
    """
    single, aggregated, d_min = strip.single, strip.aggregated, strip.single.d_min
    made = np.full((len(FEATURES), *winner.shape), np.nan, np.float32)
    least, right = np.empty(winner.shape[1], np.uint16), np.empty(winner.shape[1], np.int32)
    for y in range(len(winner)):
        _right_winner(aggregated[y], d_min, least, right)
        _evidence(single.above[y], single.least[y], aggregated[y], winner[y], right, d_min, paths, made[:, y])
    return made


@kernel
def _right_winner(
    aggregated: NDArray[np.uint16], d_min: int, least: NDArray[np.uint16], right: NDArray[np.int32]
) -> None:
    """Write the index of the least cost of each right pixel of a row; of equal costs the smallest disparity's."""
    width, depth = aggregated.shape
    least[:] = np.uint16(0xFFFF)
    right[:] = NONE
    for x in range(width):
        for d in range(*ends(x, width, d_min, depth)):
            if aggregated[x, d] < least[x - d - d_min]:
                least[x - d - d_min] = aggregated[x, d]
                right[x - d - d_min] = d


@kernel
def _evidence(
    single: NDArray[np.int16],
    least: NDArray[np.int16],
    aggregated: NDArray[np.uint16],
    winner: NDArray[np.int32],
    right: NDArray[np.int32],
    d_min: int,
    paths: int,
    made: NDArray[np.float32],
) -> None:
    """Write the features of one row."""
    width, depth = single.shape
    near, near_sum = np.int16(NEAR * SCALE), np.uint16(NEAR * SCALE * paths)
    for x in range(width):
        best = winner[x]
        if best == NONE:
            continue
        first, end = ends(x, width, d_min, depth)
        alone = first_least(single, x, first, end)
        low, low_sum = single[x, alone], aggregated[x, best]
        rival = _rival(single[x], alone, first, end, np.int16(low + CAP))
        rival_sum = _rival(aggregated[x], best, first, end, np.uint16(low_sum + paths * CAP))
        made[0, x] = (np.int64(rival_sum) - np.int64(low_sum)) / (paths * SCALE)
        made[1, x] = (np.int64(rival) - np.int64(low)) / SCALE
        made[2, x] = single[x, best] / SCALE
        made[3, x] = (np.int64(single[x, best]) + np.int64(least[x])) / SCALE
        made[4, x] = abs(best - right[x - best - d_min])
        made[5, x] = abs(alone - best) <= 1
        made[6, x] = _near(aggregated[x], np.uint16(low_sum + near_sum), first, end) / (end - first)
        made[7, x] = _near(single[x], np.int16(low + near), first, end) / (end - first)
        made[8, x] = _minima(single[x], np.int16(low + near), first, end)


@kernel
def _rival(costs: NDArray[Any], best: int, first: int, end: int, most: Any) -> Any:  # noqa: ANN401 - either integer type
    """Return the least cost that is not beside the best, at most ``most``."""
    for d in range(first, best - 1):
        most = min(most, costs[d])
    for d in range(best + 2, end):
        most = min(most, costs[d])
    return most


@kernel
def _near(costs: NDArray[Any], most: Any, first: int, end: int) -> int:  # noqa: ANN401 - either integer type
    """Return how many costs are at most ``most``."""
    count = 0
    for d in range(first, end):
        count += costs[d] <= most
    return count


@kernel
def _minima(costs: NDArray[np.int16], most: np.int16, first: int, end: int) -> int:
    """Return how many local minima cost at most ``most``; a plateau is one."""
    count, falling = 0, True
    for d in range(first, end):
        if d > first and costs[d] != costs[d - 1]:
            count += falling and costs[d] > costs[d - 1] and costs[d - 1] <= most
            falling = costs[d] < costs[d - 1]
    return count + (falling and costs[end - 1] <= most)
