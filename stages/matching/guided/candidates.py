"""Which disparities of a 4 x 4 tile can win: those that win a cheap matching at enough pixels in and around it.

The cheap matching is winner-take-all over the costs of descriptors (see ``descriptors.volume``). It errs more often on
fine structure than the matching-Net does, but in or beside a tile some pixel is mostly right, and the network judges
all that is proposed. What wins at few pixels is mostly wrong: to leave it out is worth more than the time it saves.
"""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.matching.winograd.tiles import TILE

Tiles = NDArray[np.bool_]
"""(tile row, tile column, disparity)."""


def candidates(costs: NDArray[np.float32], d_min: int, votes: int) -> Tiles:
    """Return the disparities at which each tile of 4 x 4 px should be judged.

    A disparity is proposed to a tile if it wins at ``votes`` of the 144 pixels of the tile and the eight around it,
    fewer at the image's sides; so is the one that wins at most of them. A pixel that would be left without a valid
    cell, beside the image's border, proposes its own winner.

    Args:
        costs: float32 (y + 8, x, d), with four rows of context above and below; NaN where the right pixel is outside.
        d_min: disparity of the first cost, px.
        votes: pixels a proposal needs.

    Returns:
        bool (ceil(y / 4), ceil(x / 4), d), only where a cell of the tile is valid; at least one such disparity for
        each pixel that has any.
    """
    outside = np.isnan(costs)
    winners = np.where(outside.all(2), -1, np.where(outside, np.inf, costs).argmin(2)).astype(np.int32)
    height, width = winners.shape[0] - 2 * TILE, winners.shape[1]
    chosen = np.zeros((-(-height // TILE), -(-width // TILE), costs.shape[2]), np.bool_)
    _vote(winners, d_min, votes, chosen)
    return chosen


@kernel
def _vote(winners: NDArray[np.int32], d_min: int, votes: int, chosen: Tiles) -> None:
    """Mark what the winners in and around each tile propose; -1 proposes nothing."""
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
