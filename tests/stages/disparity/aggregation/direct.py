"""Aggregation as the equation says it: one pixel, one path and one disparity at a time, in Python's own numbers."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from semidense.stages.disparity.declaration import AggregatedParams

EIGHT = [(0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, -1), (1, -1), (-1, 1)]
SIXTEEN = [*EIGHT, (1, 2), (-1, -2), (1, -2), (-1, 2), (2, 1), (-2, -1), (2, -1), (-2, 1)]


def levels(costs: NDArray, d_min: int) -> list[list[list[int]]]:
    """Return the cost of each cell above its pixel's least, in quarters, at most 160; without one 16."""
    height, width = costs.shape[:2]
    return [[_levels_of_pixel(costs[y, x], x, width, d_min) for x in range(width)] for y in range(height)]


def _levels_of_pixel(costs: NDArray, x: int, width: int, d_min: int) -> list[int]:
    quarters = [None if np.isnan(cost) else round(float(np.float16(cost)) * 4) for cost in costs]
    known = [cost for cost in quarters if cost is not None]
    if not known:
        return [0] * len(costs)
    above = [16 if cost is None else min(cost - min(known), 160) for cost in quarters]
    inside = [0 <= x - d - d_min < width for d in range(len(costs))]
    cells = [cost for cost, here in zip(above, inside, strict=True) if here]
    mean = (2 * sum(cells) + len(cells)) // (2 * len(cells)) if cells else None
    return [cost if here or mean is None else mean for cost, here in zip(above, inside, strict=True)]


def smoothed(gray: NDArray) -> NDArray:
    """Return each pixel's mean with its neighbours, weighed 1, 2, 1 both ways; a half is rounded up."""
    height, width = gray.shape
    weights = {(dy, dx): (2 - abs(dy)) * (2 - abs(dx)) for dy in (-1, 0, 1) for dx in (-1, 0, 1)}

    def at(y: int, x: int) -> int:
        return int(gray[min(max(y, 0), height - 1), min(max(x, 0), width - 1)])

    def mean(y: int, x: int) -> float:
        return sum(weight * at(y + dy, x + dx) for (dy, dx), weight in weights.items()) / 16

    return np.array([[int(mean(y, x) + 0.5) for x in range(width)] for y in range(height)])


def sums(costs: NDArray, gray: NDArray, d_min: int, params: AggregatedParams) -> NDArray[np.int64]:
    """Return the sum of all path costs, (y, x, d); of the second pass, if there are two."""
    cost = levels(costs, d_min)
    total = _sums(cost, costs.shape, gray, params)
    if params.passes == 2:
        half = params.paths // 2
        mean = np.minimum((total - total.min(2, keepdims=True) + half) // params.paths, 160)
        total = _sums((np.array(cost) + mean).tolist(), costs.shape, gray, params)
    return total


def _sums(
    cost: list[list[list[int]]], shape: tuple[int, int, int], gray: NDArray, params: AggregatedParams
) -> NDArray[np.int64]:
    height, width, depth = shape
    total = np.zeros(shape, np.int64)
    for dy, dx in SIXTEEN if params.paths == 16 else EIGHT:

        @cache
        def path(y: int, x: int, dy: int = dy, dx: int = dx) -> list[int]:
            v, u = y - dy, x - dx
            if not (0 <= v < height and 0 <= u < width):
                return cost[y][x]
            before = path(v, u, dy, dx)
            change = abs(int(gray[y, x]) - int(gray[v, u])) / params.edge
            first = params.oblique * params.p1 if dy and dx else params.p1
            p1, p2 = (round(4 * p / (1 + change**1.5)) for p in (first, params.p2))
            low = min(before)
            return [
                cost[y][x][d]
                + min(
                    before[d],
                    before[d - 1] + p1 if d > 0 else low + p2,
                    before[d + 1] + p1 if d + 1 < depth else low + p2,
                    low + p2,
                )
                - low
                for d in range(depth)
            ]

        total += np.array([[path(y, x, dy, dx) for x in range(width)] for y in range(height)])
    return total
