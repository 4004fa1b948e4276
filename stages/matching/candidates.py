"""Which disparities of a 4 x 4 tile can win: those that win a cheap matching at enough pixels in and around it.

The cheap matching is winner-take-all over the Hamming distance of census signatures of the first channel, summed
over a window. It errs more often than the network does, but in or beside a tile some pixel is mostly right, and the
network judges all that is proposed. All sums are of whole numbers: they do not depend on how the image is cut.
"""

import numpy as np
from numpy.typing import NDArray

from stages.kernel import kernel
from stages.matching.declaration import CENSUS, MARGIN
from stages.matching.winograd import TILE
from stages.transforms.census import bits_set, census_transform

Tiles = NDArray[np.bool_]
"""(tile row, tile column, disparity)."""


def candidates(channels: NDArray[np.float32], disparities: range, window: int, votes: int) -> Tiles:
    """Return the disparities at which each tile of 4 x 4 px should be judged.

    A disparity is proposed to a tile if it wins the cheap matching at ``votes`` of the 144 pixels of the tile and the
    eight around it, fewer at the image's sides; so is the one that wins at most of them. A pixel that would be left
    without a valid cell, beside the image's border, proposes its own winner.

    Args:
        channels: float32 (view, channel, y + 2 r, x + 2 r), left view first, with ``r`` px of context on every side,
            ``r = context(window)``.
        disparities: consecutive disparities, px; may be negative.
        window: side of the square over which distances are summed, px, odd.
        votes: pixels a proposal needs.

    Returns:
        bool (ceil(y / 4), ceil(x / 4), d), only where a cell of the tile is valid; at least one such disparity for
        each pixel that has any.
    """
    left, right = (census_transform(view, CENSUS) for view in channels[:, 0])
    margin = context(window)
    height, width = (length - 2 * margin for length in left.shape)
    winners = np.full((height + 2 * TILE, width), -1, np.int32)
    _match(left, right, disparities.start, len(disparities), window // 2, winners)
    chosen = np.zeros((-(-height // TILE), -(-width // TILE), len(disparities)), np.bool_)
    _vote(winners, disparities.start, votes, chosen)
    return chosen


def context(window: int) -> int:
    """Return the pixels around a block that ``candidates`` looks at: a tile, half a window, half a signature."""
    return MARGIN + window // 2


@kernel
def _match(
    left: NDArray[np.uint64],
    right: NDArray[np.uint64],
    d_min: int,
    depth: int,
    radius: int,
    winners: NDArray[np.int32],
) -> None:
    """Write the index of the disparity of least summed distance; of equal ones the first. -1 stays where none is valid.

    The rows of ``winners`` begin one tile above the block, its columns with it.
    """
    rows, width = winners.shape
    side = (left.shape[1] - width) // 2 - radius
    top = (left.shape[0] - rows) // 2 - radius
    least = np.full((rows, width), np.iinfo(np.int32).max, np.int32)
    distances = np.empty((rows + 2 * radius, width + 2 * radius), np.int32)
    columns = np.empty(width + 2 * radius, np.int32)
    for index in range(depth):
        d = d_min + index
        first, end = min(max(0, d), width), min(width, width + d)
        if first >= end:
            continue
        last = end + 2 * radius
        for v in range(rows + 2 * radius):
            for u in range(first, last):
                distances[v, u] = bits_set(left[v + top, u + side] ^ right[v + top, u + side - d])
        columns[:] = 0
        for v in range(2 * radius):
            for u in range(first, last):
                columns[u] += distances[v, u]
        for y in range(rows):
            for u in range(first, last):
                columns[u] += distances[y + 2 * radius, u]
            total = np.int32(0)
            for u in range(first, first + 2 * radius):
                total += columns[u]
            for x in range(first, end):
                total += columns[x + 2 * radius]
                if total < least[y, x]:
                    least[y, x] = total
                    winners[y, x] = index
                total -= columns[x]
            for u in range(first, last):
                columns[u] -= distances[y, u]


@kernel
def _vote(winners: NDArray[np.int32], d_min: int, votes: int, chosen: Tiles) -> None:
    """Mark what the winners in and around each tile propose."""
    rows, width = winners.shape
    depth = chosen.shape[2]
    count = np.empty(depth, np.int32)
    for row in range(chosen.shape[0]):
        for column in range(chosen.shape[1]):
            y, x, own = row * TILE, column * TILE, chosen[row, column]
            count[:] = 0
            for v in range(y, min(rows, y + 3 * TILE)):
                for u in range(max(0, x - TILE), min(width, x + 2 * TILE)):
                    if winners[v, u] >= 0:
                        count[winners[v, u]] += 1
            enough = min(votes, count.max())
            for k in range(depth):
                inside = x + TILE > d_min + k and x < width + d_min + k
                own[k] = inside and count[k] >= max(enough, 1)
            for v in range(y + TILE, min(rows - TILE, y + 2 * TILE)):
                for u in range(x, min(width, x + TILE)):
                    first, end = max(0, u - d_min - width + 1), max(0, u - d_min + 1)  # those valid at this column
                    if winners[v, u] >= 0 and not own[first:end].any():
                        own[winners[v, u]] = True
