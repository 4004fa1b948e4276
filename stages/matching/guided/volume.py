"""The guided cost volume: the exact one in the cells that can win, nothing in the others.

The descriptor-Net proposes disparities to each tile of 4 x 4 px (see ``candidates``), and the matching-Net judges these
(see ``sparse``). A cell that was not judged is NaN, as one whose right pixel lies outside the image is, so that
whatever reads a volume passes over both; they differ in that ``x - d`` is a column of the image for the former.
"""

from collections.abc import Iterator

import numpy as np
import torch
from numpy.typing import NDArray

from semidense.stages.compute.precision import Precision
from semidense.stages.compute.threads import one_thread
from semidense.stages.matching.declaration import MARGIN, RADIUS
from semidense.stages.matching.descriptors.net import DescriptorNet
from semidense.stages.matching.descriptors.volume import padded_fast_costs
from semidense.stages.matching.guided.candidates import Tiles, candidates
from semidense.stages.matching.guided.sparse import BATCH, judge_tiles
from semidense.stages.matching.net import MatchingNet, require_views
from semidense.stages.matching.winograd.tiles import TILE
from semidense.stages.stage import require_shape

COLUMNS = 64
"""Columns of tiles gone through at all disparities before the next: what they meet in the views stays in the cache."""


@one_thread()
def padded_guided_costs(
    net: MatchingNet,
    descriptor_net: DescriptorNet,
    channels: NDArray[np.float32],
    disparities: range,
    votes: int,
    precision: Precision = "float32",
) -> NDArray[np.float32]:
    """Return the matching costs of a pair, or a tile of one, in the cells that can win.

    Args:
        net: the matching-Net, which judges.
        descriptor_net: the descriptor-Net, which proposes.
        channels: float32 (view, channel, y, x), left view first, with ``MARGIN`` px of context on every side.
        disparities: consecutive disparities, px; may be negative.
        votes: pixels that a proposal needs.
        precision: arithmetic of the convolutions.

    Returns:
        float32 (y, x, d): log-odds of a mismatch; NaN where a cell was not judged or its right pixel is outside the
        image. A pixel with any valid cell has a cost in at least one.

    Raises:
        StageError: if the channels do not fit the networks.
    """
    require_shape("channels", channels, 4)
    require_views(net, channels)
    height, width = (length - 2 * MARGIN for length in channels.shape[2:])
    proposing = padded_fast_costs(descriptor_net, channels[..., TILE:-TILE], disparities, precision)
    chosen = candidates(proposing, disparities.start, votes)
    volume = np.full((*(TILE * count for count in chosen.shape[:2]), len(disparities)), np.nan, np.float32)
    tiles = volume.reshape(chosen.shape[0], TILE, chosen.shape[1], TILE, len(disparities))
    with torch.inference_mode():
        own = slice(MARGIN - RADIUS, RADIUS - MARGIN)
        judge = judge_tiles(net, torch.from_numpy(np.ascontiguousarray(channels[:, :, own, own])), precision)
        for row, column, index in _batches(chosen):
            places = np.stack([row * TILE, column * TILE, index + disparities.start], 1)
            tiles[row, :, column, :, index] = judge(places)
    matched = np.arange(width)[:, None] - np.array(disparities)  # the right pixel's column
    volume[:, :width][:, (matched < 0) | (matched >= width)] = np.nan
    return np.ascontiguousarray(volume[:height, :width])


def _batches(chosen: Tiles) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]]:
    """Yield rows, columns and disparities of tiles, such that those of a batch lie near each other at one disparity."""
    for first in range(0, chosen.shape[1], COLUMNS):
        index, row, column = np.nonzero(chosen[:, first : first + COLUMNS].transpose(2, 0, 1))
        for start in range(0, len(index), BATCH):
            batch = slice(start, start + BATCH)
            yield row[batch], column[batch] + first, index[batch]
