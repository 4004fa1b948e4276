"""The cost volume ``C(y, x, d)``: the log-odds that left pixel (y, x) and right pixel (y, x - d) mismatch.

Everything that does not depend on the disparity is computed once (see ``net``); a disparity costs an
addition, a ReLU, conv3 and the head. A cell whose right pixel lies outside the image is not computed:
it is NaN, and can never win. Lower is better; ``1 / (1 + exp(-cost))`` is the probability of a mismatch.
"""

from collections.abc import Callable
from itertools import product

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from semidense.stages.compute.precision import Precision, autocast, dtype_of
from semidense.stages.compute.threads import one_thread
from semidense.stages.matching.declaration import RADIUS, CostVolumeParams, OfNetworks
from semidense.stages.matching.descriptors.net import descriptor_net_from_parameters
from semidense.stages.matching.descriptors.volume import padded_fast_costs
from semidense.stages.matching.guided.volume import padded_guided_costs
from semidense.stages.matching.net import SIDES, MatchingNet, net_from_parameters, require_views
from semidense.stages.matching.winograd.tiles import TILE
from semidense.stages.matching.winograd.volume import TransformedNet, is_transformable, run_blocks
from semidense.stages.stage import CostVolume, require_shape

ROWS, COLUMNS = 32, 64
"""Cells computed at once: few enough for all that is in between to stay in the processor's cache."""

Costs = Callable[[int, int, int, int], NDArray[np.float32]]
"""``costs(y, x, columns, disparity)``: of at most ROWS rows, fewer at the bottom, from a cell on."""


def valid_columns(disparity: int, width: int) -> tuple[int, int]:
    """Return the first and the end column whose right pixel, ``x - disparity``, is inside the image."""
    first = min(max(0, disparity), width)
    return first, max(first, min(width, width + disparity))


def cost_volume(
    net: MatchingNet,
    channels: NDArray[np.float32],
    disparities: range,
    precision: Precision = "float32",
) -> NDArray[np.float32]:
    """Return the matching costs of a whole pair.

    Args:
        net: the matching-Net.
        channels: float32 (view, channel, y, x), left view first.
        disparities: consecutive disparities, px; may be negative.
        precision: arithmetic of the convolutions.

    Returns:
        float32 (y, x, d): log-odds of a mismatch, NaN where the right pixel is outside the image.

    Raises:
        StageError: if the channels do not fit the network.
    """
    require_shape("channels", channels, 4)
    margin = ((0, 0), (0, 0), (RADIUS, RADIUS), (RADIUS, RADIUS))
    return padded_cost_volume(net, np.pad(channels, margin, mode="edge"), disparities, precision)


@one_thread()
def padded_cost_volume(
    net: MatchingNet,
    channels: NDArray[np.float32],
    disparities: range,
    precision: Precision = "float32",
) -> NDArray[np.float32]:
    """Return the matching costs of views that bring 5 px of context on every side.

    As ``cost_volume``, for (view, channel, y + 10, x + 10): rows of a larger image with their
    neighbours, its whole width with its edge repeated.
    """
    require_views(net, channels)
    height, width = (length - 2 * RADIUS for length in channels.shape[2:])
    volume = np.full((height, width, len(disparities)), np.nan, np.float32)
    with torch.inference_mode():
        views = torch.from_numpy(np.ascontiguousarray(channels))
        costs = (_transformed if is_transformable(net) else _direct)(net, views, precision)
        # Disparities go innermost: a block of the left view, and what it meets in the right, stay in the cache.
        for y, block in product(range(0, height, ROWS), range(0, width, COLUMNS)):
            for index, disparity in enumerate(disparities):
                first, end = valid_columns(disparity, width)
                start, stop = max(block, first), min(block + COLUMNS, end)
                if start < stop:
                    volume[y : y + ROWS, start:stop, index] = costs(y, start, stop - start, disparity)
    return volume


def _direct(net: MatchingNet, views: Tensor, precision: Precision) -> Costs:
    """Return costs by the network's own convolutions."""
    with autocast(precision):
        left, right = (
            net.embed(view[None], side).contiguous(memory_format=torch.channels_last)
            for view, side in zip(views, SIDES, strict=True)
        )
    reach = 2 * RADIUS - 4  # what conv3 and the head still take from each side together

    def costs(y: int, x: int, columns: int, disparity: int) -> NDArray[np.float32]:
        rows = slice(y, y + ROWS + reach)
        one = left[..., rows, x : x + columns + reach]
        other = right[..., rows, x - disparity : x - disparity + columns + reach]
        with autocast(precision):
            made: NDArray[np.float32] = net.log_odds(functional.relu(one + other))[0].numpy()
        return made

    return costs


def _transformed(net: MatchingNet, views: Tensor, precision: Precision) -> Costs:
    """Return costs by transformed convolutions: the same numbers, by fewer products."""
    height = views.shape[2] - 2 * RADIUS
    dtype = dtype_of(precision)
    transformed = TransformedNet.of(net, dtype)
    left, right = (
        # The filters of a pixel lie side by side; tiles at the borders may reach over the edge.
        functional.pad(net.embed_layers(view[None], side).permute(0, 2, 3, 1).to(dtype), (0, 0, TILE, TILE, 0, TILE))
        for view, side in zip(views, SIDES, strict=True)
    )

    def costs(y: int, x: int, columns: int, disparity: int) -> NDArray[np.float32]:
        rows, before = min(ROWS, height - y), x % TILE  # tiles begin at the same columns whatever the disparity
        shape = -(-rows // TILE), -(-(before + columns) // TILE)
        corner = y, x - before + TILE, x - before - disparity + TILE
        units = run_blocks(transformed, left, right, [corner], shape).units[0]
        made: NDArray[np.float32] = net.odds_of_features(units)[:rows, before : before + columns].numpy()
        return made

    return costs


def compute_costs(params: CostVolumeParams, inputs: OfNetworks) -> CostVolume:
    """Return one tile of the volume: ``cost`` float16 (y, x, d) and its coordinate ``d`` int16."""
    costs = torch.from_numpy(_costs(params, inputs)).half()  # NumPy rounds to the same, one number at a time
    return {"cost": costs.numpy(), "d": np.array(params.disparities, np.int16)}


def _costs(params: CostVolumeParams, inputs: OfNetworks) -> NDArray[np.float32]:
    channels, disparities, precision = inputs["channels"]["channels"], params.disparities, params.precision
    if params.mode == "exact":
        net = net_from_parameters(inputs["matching_net"]["parameters"], channels.shape[1])
        return padded_cost_volume(net, channels, disparities, precision)
    descriptor_net = descriptor_net_from_parameters(inputs["descriptor_net"]["parameters"], channels.shape[1])
    if params.mode == "fast":
        return padded_fast_costs(descriptor_net, channels, disparities, precision)
    net = net_from_parameters(inputs["matching_net"]["parameters"], channels.shape[1])
    return padded_guided_costs(net, descriptor_net, channels, disparities, params.votes, precision)
