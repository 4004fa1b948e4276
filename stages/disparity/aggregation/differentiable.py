"""Sums along eight paths whose gradient is known, so that a network can learn the costs that go into them.

The recursion is that of ``paths``, in float32 on costs as they come: nothing is rounded to levels. A sum takes the best
of four ways to come to a cell, so it is linear in the costs on these ways, and its gradient flows back along them.
Direct learning through such paths is known from SGM-Net (Seki and Pollefeys, CVPR 2017) and GA-Net (Zhang et al.,
CVPR 2019), which learn penalties; here the costs themselves learn, and the penalties stay.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semidense.stages.compute.kernel import kernel
from semidense.stages.disparity.aggregation.edges import difference, is_oblique
from semidense.stages.disparity.aggregation.paths import DOWN

STEPS = np.concatenate([DOWN[:4], -DOWN[:4]])
"""Steps (rows, columns) of the eight paths."""
BEYOND = np.float32(1e9)
"""Stands for the cost beyond both ends of the range."""
SAME, FROM_BELOW, FROM_ABOVE, JUMP, BEGIN = range(5)
"""Ways to come to a cell: from the same disparity, one less, one more, the least of any, or where a path begins."""


def path_sums(costs: Tensor, gray: NDArray[np.uint8], penalties: NDArray[np.float32]) -> Tensor:
    """Return the costs summed along the paths, differentiable with respect to the costs.

    Args:
        costs: float32 (y, x, d), finite.
        gray: (y, x) uint8 of the same view: penalties are smaller across its edges.
        penalties: (straight or oblique, difference of gray 0 to 255, P1 or P2) float32, in units of the costs.

    Returns:
        float32 (y, x, d), in units of the costs: of each cell the sum over all paths.
    """
    sums: Tensor = _PathSums.apply(costs.contiguous(), np.ascontiguousarray(gray), penalties)  # type: ignore[no-untyped-call]
    return sums


class _PathSums(torch.autograd.Function):
    """The sums, and how a gradient goes back from them to the costs."""

    @staticmethod
    def forward(ctx: Any, costs: Tensor, gray: NDArray[np.uint8], table: NDArray[np.float32]) -> Tensor:  # noqa: ANN401
        ways = np.empty((len(STEPS), *costs.shape), np.int8)
        least = np.empty(ways.shape[:3], np.int32)
        sums = np.zeros(costs.shape, np.float32)
        _sum(costs.numpy(), gray, STEPS, table, ways, least, sums)
        ctx.followed = ways, least
        return torch.from_numpy(sums)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None]:  # noqa: ANN401
        ways, least = ctx.followed
        costs = np.zeros(gradient.shape, np.float32)
        _return(gradient.contiguous().numpy(), STEPS, ways, least, costs)
        return torch.from_numpy(costs), None, None


@kernel
def _order(step: NDArray[np.int64], place: int, length: int, axis: int) -> int:
    """Return the place-th row or column in an order in which each pixel comes after the one that a path comes from."""
    backwards = step[axis] < 0 or (axis == 1 and step[0] < 0 and step[1] == 0)
    return length - 1 - place if backwards else place


@kernel
def _sum(
    costs: NDArray[np.float32],
    gray: NDArray[np.uint8],
    steps: NDArray[np.int64],
    penalties: NDArray[np.float32],
    ways: NDArray[np.int8],
    least: NDArray[np.int32],
    sums: NDArray[np.float32],
) -> None:
    """Follow every path and add its costs to ``sums``; note the way to each cell, and each pixel's least."""
    height, width, depth = costs.shape
    path = np.full((height, width, depth + 2), BEYOND, np.float32)
    for p in range(len(steps)):
        table = penalties[is_oblique(steps[p, 0], steps[p, 1])]
        for row in range(height):
            for column in range(width):
                y, x = _order(steps[p], row, height, 0), _order(steps[p], column, width, 1)
                v, u = y - steps[p, 0], x - steps[p, 1]
                if 0 <= v < height and 0 <= u < width:
                    change = difference(gray, y, x, v, u)
                    low = path[v, u, least[p, v, u] + 1]
                    _extend(path[v, u], low, table[change, 0], table[change, 1], costs[y, x], path[y, x], ways[p, y, x])
                else:
                    path[y, x, 1:-1] = costs[y, x]
                    ways[p, y, x] = BEGIN
                least[p, y, x] = np.argmin(path[y, x, 1:-1])
                for d in range(depth):
                    sums[y, x, d] += path[y, x, d + 1]


@kernel
def _extend(
    before: NDArray[np.float32],
    low: np.float32,
    small: np.float32,
    large: np.float32,
    costs: NDArray[np.float32],
    now: NDArray[np.float32],
    ways: NDArray[np.int8],
) -> None:
    """Extend one path by one pixel: of equal ways the first counts."""
    jump = np.float32(low + large)
    for d in range(len(costs)):
        best, way = before[d + 1], np.int8(SAME)
        for other, cost in (
            (np.int8(FROM_BELOW), np.float32(before[d] + small)),
            (np.int8(FROM_ABOVE), np.float32(before[d + 2] + small)),
            (np.int8(JUMP), jump),
        ):
            way = other if cost < best else way
            best = min(cost, best)
        now[d + 1] = np.float32(np.float32(best - low) + costs[d])
        ways[d] = way


@kernel
def _return(
    gradient: NDArray[np.float32],
    steps: NDArray[np.int64],
    ways: NDArray[np.int8],
    least: NDArray[np.int32],
    costs: NDArray[np.float32],
) -> None:
    """Follow every path back, and add what reaches each cell to the gradient of its cost."""
    height, width, depth = gradient.shape
    flow = np.zeros((height, width, depth + 2), np.float32)
    for p in range(len(steps)):
        flow[..., 1:-1] = gradient
        for row in range(height - 1, -1, -1):
            for column in range(width - 1, -1, -1):
                y, x = _order(steps[p], row, height, 0), _order(steps[p], column, width, 1)
                for d in range(depth):
                    costs[y, x, d] += flow[y, x, d + 1]
                v, u = y - steps[p, 0], x - steps[p, 1]
                if 0 <= v < height and 0 <= u < width:
                    _hand_on(flow[y, x], ways[p, y, x], least[p, v, u] + 1, flow[v, u])


@kernel
def _hand_on(now: NDArray[np.float32], ways: NDArray[np.int8], least: int, before: NDArray[np.float32]) -> None:
    """Add the gradient of a pixel's path costs to that of the pixel before: each along its way, less the least's."""
    total = jumped = np.float32(0)
    for d in range(len(ways)):
        here = now[d + 1]
        total += here
        jumped += here if ways[d] == JUMP else np.float32(0)
        before[d + 1] += here if ways[d] == SAME else np.float32(0)
    for d in range(len(ways)):
        before[d] += now[d + 1] if ways[d] == FROM_BELOW else np.float32(0)
    for d in range(len(ways)):
        before[d + 2] += now[d + 1] if ways[d] == FROM_ABOVE else np.float32(0)
    before[least] += jumped - total
