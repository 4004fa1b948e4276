"""The costs of paths: what it costs to come to a pixel at a disparity from one direction.

``L_r(p, d) = C(p, d) + min(L_r(p-r, d), L_r(p-r, d±1) + P1, min_k L_r(p-r, k) + P2) - min_k L_r(p-r, k)``

The penalties P1 and P2 depend on the direction and on the view (``edges``). A path begins at the image's border with
the costs themselves. Of each pair of opposite directions, one is followed going down the image and the other going up,
so two passes over the rows follow all.

Source: Hirschmüller, "Stereo processing by semiglobal matching and mutual information", PAMI 2008.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.disparity.aggregation.edges import difference, is_oblique, penalties
from semidense.stages.disparity.declaration import AggregatedParams

DOWN = np.array([(0, 1), (1, -1), (1, 0), (1, 1), (1, 2), (1, -2), (2, 1), (2, -1)])
"""Steps ``r`` (rows, columns) of the paths that are followed going down: the first four of 8 paths, all of 16."""
BEYOND = np.int16(16_000)
"""Stands for the cost beyond both ends of the range: above every path's, also with a penalty added."""


def steps_down(params: AggregatedParams) -> NDArray[np.int64]:
    """Return the steps of the paths that are followed going down, (path, 2)."""
    return DOWN[: params.paths // 2]


@dataclass(frozen=True)
class Front:
    """The path costs of the last rows that a pass went over: all that the next row needs.

    Attributes:
        costs: (path, row, x, d) int16, levels, with a margin of columns where paths begin and one cell of ``BEYOND``
            at both ends of the range.
        least: (path, row, x) int16: the least of each pixel.
    """

    costs: NDArray[np.int16]
    least: NDArray[np.int16]

    @classmethod
    def beginning(cls, steps: NDArray[np.int64], width: int, depth: int) -> Self:
        """Return what is before the first row: paths that begin."""
        rows, margin = np.abs(steps).max(axis=0)
        costs = np.zeros((len(steps), rows, width + 2 * margin, depth + 2), np.int16)
        costs[..., [0, -1]] = BEYOND
        return cls(costs, np.zeros(costs.shape[:3], np.int16))


def follow(
    above: NDArray[np.int16],
    gray: NDArray[np.uint8],
    top: int,
    params: AggregatedParams,
    front: Front,
    sums: NDArray[np.int16],
    *,
    upwards: bool,
) -> Front:
    """Follow the paths of one pass through some rows, and add their costs to ``sums``.

    Args:
        above: (y, x, d) int16 costs of the rows, levels above the pixel's least, at most ``2 * CAP``.
        gray: (y, x) uint8 of the whole view, smoothed.
        top: the row of the image that is the first of ``above``.
        params: paths and penalties.
        front: of the rows before, which lie below when going upwards.
        sums: (y, x, d) int16, levels, modulo 2 ** 16; the path costs are added.
        upwards: go from the last row to the first, along the opposite directions.

    Returns:
        The front after these rows.
    """
    # One more row, which the first row is written to; afterwards the oldest row goes.
    costs, least = (np.concatenate([each, each[:, :1]], axis=1) for each in (front.costs, front.least))
    steps, table = steps_down(params), penalties(params)
    _follow(above, gray, top, steps, table, costs, least, sums, upwards)
    turn = -(len(above) % costs.shape[1])
    return Front(*(np.roll(each, turn, axis=1)[:, :-1].copy() for each in (costs, least)))


@kernel
def _follow(
    above: NDArray[np.int16],
    gray: NDArray[np.uint8],
    top: int,
    steps: NDArray[np.int64],
    table: NDArray[np.int16],
    costs: NDArray[np.int16],
    least: NDArray[np.int16],
    sums: NDArray[np.int16],
    upwards: bool,
) -> None:
    """Follow the paths through all rows; a row's path costs replace the oldest ones."""
    height, slots = above.shape[0], costs.shape[1]
    sign = -1 if upwards else 1
    for row in range(height):
        y = height - 1 - row if upwards else row
        now = (slots - 1 + row) % slots
        for path in range(len(steps)):
            dy, dx = sign * steps[path, 0], sign * steps[path, 1]
            before = (now - steps[path, 0]) % slots
            _follow_row(
                above[y],
                gray,
                top + y,
                dy,
                dx,
                table[is_oblique(dy, dx)],
                costs[path, before],
                costs[path, now],
                least[path, before],
                least[path, now],
                sums[y],
                upwards,
            )


@kernel
def _follow_row(
    above: NDArray[np.int16],
    gray: NDArray[np.uint8],
    y: int,
    dy: int,
    dx: int,
    table: NDArray[np.int16],
    before: NDArray[np.int16],
    now: NDArray[np.int16],
    least_before: NDArray[np.int16],
    least_now: NDArray[np.int16],
    sums: NDArray[np.int16],
    backwards: bool,
) -> None:
    """Follow the paths of one direction through row ``y`` of the image, from the row that they come from."""
    width = len(above)
    margin = (len(now) - width) // 2
    for column in range(width):
        x = width - 1 - column if backwards else column
        own, other = x + margin, x - dx + margin
        change = difference(gray, y, x, y - dy, x - dx)
        least_now[own] = _extend(
            before, other, now, own, least_before[other], table[change, 0], table[change, 1], above, sums, x
        )


@kernel
def _extend(
    before: NDArray[np.int16],
    other: int,
    now: NDArray[np.int16],
    own: int,
    low: np.int16,
    small: np.int16,
    large: np.int16,
    above: NDArray[np.int16],
    sums: NDArray[np.int16],
    x: int,
) -> np.int16:
    """Extend one path by one pixel, add its costs to the sums, and return its least.

    The casts keep every number in 16 bits, so that many disparities are computed at once. Pixels are indexed, not cut
    out: a cut of an array costs as much time as these sums.
    """
    jump = np.int16(low + large)
    least = BEYOND
    for d in range(above.shape[1]):
        step = np.int16(min(before[other, d], before[other, d + 2]) + small)
        best = min(min(before[other, d + 1], jump), step)
        cost = np.int16(np.int16(best - low) + above[x, d])
        now[own, d + 1] = cost
        sums[x, d] = np.int16(sums[x, d] + cost)
        least = min(least, cost)
    return least
