"""The fast cost volume: dot products of descriptors, computed once a view (see ``descriptors.net``).

Of a row, all products of some left descriptors with those that they may meet in the right view are one product of two
matrices; the cells of the volume are its diagonals.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from semidense.stages.compute.precision import Precision
from semidense.stages.compute.threads import one_thread
from semidense.stages.matching.declaration import REACH
from semidense.stages.matching.descriptors.net import DescriptorNet
from semidense.stages.matching.descriptors.view import described_views
from semidense.stages.stage import StageError, require_shape

COLUMNS = 64
"""Columns of the left view that are compared at once: a wider product has more that is no cell."""


def fast_cost_volume(
    net: DescriptorNet, channels: NDArray[np.float32], disparities: range, precision: Precision = "float32"
) -> NDArray[np.float32]:
    """Return the matching costs of a whole pair, by descriptors.

    Args:
        net: the descriptor-Net.
        channels: float32 (view, channel, y, x), left view first.
        disparities: consecutive disparities, px; may be negative.
        precision: arithmetic of the convolutions; the products of descriptors are float32.

    Returns:
        float32 (y, x, d): log-odds of a mismatch, NaN where the right pixel is outside the image.

    Raises:
        StageError: if the channels do not fit the network.
    """
    require_shape("channels", channels, 4)
    margin = ((0, 0), (0, 0), (REACH, REACH), (REACH, REACH))
    return padded_fast_costs(net, np.pad(channels, margin, mode="edge"), disparities, precision)


@one_thread()
def padded_fast_costs(
    net: DescriptorNet, channels: NDArray[np.float32], disparities: range, precision: Precision = "float32"
) -> NDArray[np.float32]:
    """As ``fast_cost_volume``, of views that bring 8 px of context on every side."""
    if channels.shape[:2] != (2, net.channels):
        raise StageError(f"descriptor-Net expects 2 views of {net.channels} channels, got {channels.shape[:2]}")
    height, width = (length - 2 * REACH for length in channels.shape[2:])
    volume = np.empty((height, width, len(disparities)), np.float32)
    with torch.inference_mode():
        left, right = described_views(net, channels, precision)
        smallest, largest = disparities[0], disparities[-1]
        # Beyond the right view there are zeros, so that every product has all its diagonals.
        right = functional.pad(right, (0, 0, max(0, largest), max(0, -smallest)))
        for first in range(0, width, COLUMNS):
            block = left[:, first : first + COLUMNS]
            start = first - largest + max(0, largest)
            strip = right[:, start : start + block.shape[1] + len(disparities) - 1]
            costs = net.log_odds(diagonals(block @ strip.mT, len(disparities)))
            volume[:, first : first + COLUMNS] = costs.numpy()[..., ::-1]
    matched = np.arange(width)[:, None] - np.array(disparities)  # the right pixel's column
    volume[:, (matched < 0) | (matched >= width)] = np.nan
    return volume


def diagonals(products: Tensor, count: int) -> Tensor:
    """Return ``products[y, x, x + k]`` for k from 0 to ``count``: (y, x, x + count - 1) -> (y, x, count)."""
    rows, columns, length = products.shape
    return products.contiguous().as_strided((rows, columns, count), (columns * length, length + 1, 1))
