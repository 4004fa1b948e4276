"""The descriptors of a view, the quickest way in each arithmetic.

They are transformed convolutions in float32, and plain ones in bfloat16.
With matrix units (AMX), plain convolutions take a third of the time of transformed ones, whose transforms are float32.
They also round less: a tile's inverse transform weighs its rounded numbers by up to 64.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from semidense.stages.compute.precision import Precision, dtype_of
from semidense.stages.matching.declaration import REACH
from semidense.stages.matching.descriptors.net import DescriptorNet
from semidense.stages.matching.descriptors.transformed import kernels_of, transformed_descriptors

ROWS = 64
"""Rows of descriptors that plain convolutions make at once: their maps stay in the processor's cache."""


def described_views(net: DescriptorNet, views: NDArray[np.float32], precision: Precision) -> list[Tensor]:
    """Return the descriptors of each view, within ``torch.inference_mode``.

    Args:
        net: the network.
        views: (view, channel, y + 16, x + 16).
        precision: arithmetic of the convolutions.

    Returns:
        For each view (y, x, filter) float32, of unit length.
    """
    tensors = torch.from_numpy(np.ascontiguousarray(views))
    if dtype_of(precision) == torch.bfloat16:
        return [_plain(net, view) for view in tensors]
    kernels = kernels_of(net)
    return [transformed_descriptors(net, kernels, view) for view in tensors]


def _plain(net: DescriptorNet, view: Tensor) -> Tensor:
    """Return the descriptors of a view by plain convolutions in bfloat16; a row does not depend on the others."""
    height, width = (length - 2 * REACH for length in view.shape[1:])
    layers = [(layer.weight.bfloat16(), layer.bias.bfloat16(), layer.dilation) for layer in [*net.hidden, net.out]]
    made = torch.empty(height, width, net.width)
    for first in range(0, height, ROWS):
        maps = net.normalised(view[None, :, first : first + ROWS + 2 * REACH])
        maps = maps.bfloat16().contiguous(memory_format=torch.channels_last)
        for weight, bias, step in layers[:-1]:
            maps = functional.conv2d(maps, weight, bias, dilation=step)
            maps.view(torch.int16).clamp_min_(0)  # the ReLU, by the sign bit: torch's own takes as long as a layer
        weight, bias, step = layers[-1]
        out = functional.conv2d(maps, weight, bias, dilation=step)[0].permute(1, 2, 0).float()
        functional.normalize(out, dim=2, out=made[first : first + ROWS])
    return made
