"""The cost volume ``C(y, x, d)``: the log-odds that left pixel (y, x) and right pixel (y, x - d) mismatch.

Everything that does not depend on the disparity is computed once (see ``net``); a disparity costs an
addition, a ReLU, conv3 and the head. A cell whose right pixel lies outside the image is not computed:
it is NaN, and can never win. Lower is better; ``1 / (1 + exp(-cost))`` is the probability of a mismatch.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from stages.allocator import keep_freed_memory
from stages.matching.declaration import RADIUS, CostVolumeParams
from stages.matching.net import MatchingNet, net_from_parameters
from stages.precision import Precision, autocast
from stages.stage import Inputs, StageError, require_shape
from stages.training import one_thread

COLUMNS = 192
"""Columns computed at once: small enough for the joined maps to stay in the processor's cache."""


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
    if channels.shape[:2] != (2, net.channels):
        raise StageError(f"matching-Net expects 2 views of {net.channels} channels, got {channels.shape[:2]}")
    height, width = (length - 2 * RADIUS for length in channels.shape[2:])
    volume = np.full((len(disparities), height, width), np.nan, np.float32)
    keep_freed_memory()
    one_thread()
    with torch.inference_mode(), autocast(precision):
        left, right = _embedded(net, channels)
        for index, disparity in enumerate(disparities):
            first, end = valid_columns(disparity, width)
            for start in range(first, end, COLUMNS):
                stop = min(start + COLUMNS, end)
                volume[index, :, start:stop] = _costs(net, left, right, disparity, start, stop)
    return np.ascontiguousarray(volume.transpose(1, 2, 0))


def _embedded(net: MatchingNet, channels: NDArray[np.float32]) -> tuple[Tensor, Tensor]:
    views = torch.from_numpy(np.ascontiguousarray(channels))
    left = net.embed(views[:1], "left").contiguous(memory_format=torch.channels_last)
    right = net.embed(views[1:], "right").contiguous(memory_format=torch.channels_last)
    return left, right


def _costs(net: MatchingNet, left: Tensor, right: Tensor, disparity: int, start: int, stop: int) -> NDArray[np.float32]:
    """Return the costs (y, x) of columns start..stop at one disparity."""
    reach = 2 * RADIUS - 4  # what conv3 and the head still take from each side together
    joined = functional.relu(left[..., start : stop + reach] + right[..., start - disparity : stop - disparity + reach])
    costs: NDArray[np.float32] = net.log_odds(joined)[0].numpy()
    return costs


def compute_costs(params: CostVolumeParams, inputs: Inputs) -> dict[str, NDArray[np.generic]]:
    """Return one tile of the volume: ``cost`` float16 (y, x, d) and its coordinate ``d`` int16."""
    channels = inputs["channels"]["channels"]
    net = net_from_parameters(inputs["matching_net"]["parameters"], channels.shape[1])
    costs = padded_cost_volume(net, channels, params.disparities, params.precision)
    return {"cost": costs.astype(np.float16), "d": np.array(params.disparities, np.int16)}
