"""descriptor-Net: it compares descriptors of pixels instead of judging pairs of patches.

A *fast* volume is its answer; of a *guided* one it proposes the cells.

Each pixel of a view gets a descriptor, numbers of unit length, from the 17 x 17 px around it; both views go
through the same four convolutions, so a pair costs two passes whatever its range of disparities. The cost of a cell is
linear in the dot product of its two descriptors: the log-odds of a mismatch, as the matching-Net gives them. Siamese
networks with a dot product are the fast architecture of Zbontar and LeCun (JMLR 2016); the paper here has none.

Dilated kernels see the wider window for the price of the narrow one. It helps where there is little texture.
"""

from collections.abc import Iterator
from functools import lru_cache, partial
from typing import get_args

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from semidense.stages.learning.parameters import count, from_vector, unset
from semidense.stages.matching.declaration import DILATIONS
from semidense.stages.matching.descriptors.declaration import WIDTH, Width
from semidense.stages.stage import StageError

SCALE = 20.0
"""Cost of a cell whose descriptors are orthogonal above one whose are equal, before training."""


class DescriptorNet(nn.Module):
    """Descriptors of a view of ``channels`` channels.

    Args:
        channels: channels a view; 3 for gray, rank and companion.
        width: filters of a layer, and numbers of a descriptor.
    """

    input_mean: Tensor
    input_std: Tensor

    def __init__(self, channels: int = 3, width: Width = WIDTH) -> None:
        super().__init__()
        if channels < 1:
            raise StageError(f"descriptor-Net needs at least one channel, got {channels}")
        self.channels, self.width = channels, width
        self.register_buffer("input_mean", torch.zeros(channels))
        self.register_buffer("input_std", torch.ones(channels))
        inputs = [channels, *[width] * (len(DILATIONS) - 1)]
        layers = [nn.Conv2d(given, width, 3, dilation=step) for given, step in zip(inputs, DILATIONS, strict=True)]
        self.hidden, self.out = nn.ModuleList(layers[:-1]), layers[-1]
        self.log_scale = nn.Parameter(torch.tensor([np.log(SCALE)], dtype=torch.float32))
        self.bias = nn.Parameter(torch.zeros(1))

    def forward(self, view: Tensor) -> Tensor:
        """Return descriptors of unit length: (B, channels, H, W) -> (B, width, H - 16, W - 16) float32."""
        maps = self.normalised(view)
        for layer in self.hidden:
            maps = functional.relu(layer(maps))
        return functional.normalize(self.out(maps).float(), dim=1)

    def normalised(self, view: Tensor) -> Tensor:
        """Return the channels of a view as the first layer takes them: (B, channels, H, W), of the same shape."""
        return (view - self.input_mean[:, None, None]) / self.input_std[:, None, None]

    def log_odds(self, products: Tensor) -> Tensor:
        """Return the log-odds of a mismatch from dot products of descriptors, of any shape."""
        return self.bias - self.log_scale.exp() * products


def descriptor_nets(channels: int) -> Iterator[DescriptorNet]:
    """Yield a network of each width, the usual one first; the number of parameters tells them apart."""
    widths = sorted(get_args(Width), key=lambda width: width != WIDTH)
    return (unset(partial(DescriptorNet, channels, width)) for width in widths)


def descriptor_net_from_parameters(parameters: NDArray[np.float32], channels: int) -> DescriptorNet:
    """Return the network that a vector of parameters belongs to, ready for inference.

    It is built once for all tiles of a volume, so nobody may change it.

    Args:
        parameters: float32 (parameter,), as ``to_vector`` makes them.
        channels: channels a view of the images at hand.

    Raises:
        StageError: if the network was trained on other channels.
    """
    return _built(np.ascontiguousarray(parameters, np.float32).tobytes(), channels)


@lru_cache(maxsize=2)
def _built(parameters: bytes, channels: int) -> DescriptorNet:
    vector = np.frombuffer(parameters, np.float32)
    for net in descriptor_nets(channels):
        if count(net) == vector.size:
            from_vector(net, vector)
            return net.to(memory_format=torch.channels_last)  # type: ignore[call-overload, no-any-return]
    raise StageError(
        f"the descriptor-Net's {vector.size} parameters do not fit {channels} channel(s) a view: "
        "it was trained on other channels; train one for these, or go back to the channels it knows"
    )
