"""evaluation-Net: the network that says whether a disparity is right (the paper's Table 1, right).

Input of one sample: 101 x 101 pixels of the left view and of its raw disparity map.

    layer         kernel, filters   output a layer
    conv1, pool   3x3, 16           99, 49     the same weights on both input layers
    conv2, pool   3x3, 32           47, 23     the same weights on both
    conv3, pool   3x3, 64           21, 10     the same weights on both
    conv4, pool   3x3x2, 128        8, 4       joins the two layers: a sum of one convolution each
    fc            128               1
    out           2                 1          output 1: the disparity is right, output 0: it is wrong

The poolings round down, so a patch's last 7 rows and columns never reach the output: patches align by
their top left corners, and the answer at a corner depends on 94 x 94 pixels.

A pooled network on a larger map answers at every 16th pixel (``forward``, used in training). ``dense``
answers at every pixel by pooling at all four offsets, which splits a map into four *fragments*, each a
quarter of the size; after four poolings 256 fragments interleave to the whole map. The convolutions
stay plain, and none is computed twice. Where the first poolings are left plain, it answers at every second or
fourth pixel, for a quarter or a sixteenth of the work.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from semidense.stages.compute.kernel import kernel
from semidense.stages.evaluation.declaration import PATCH, STRIDE
from semidense.stages.learning.parameters import from_vector, unset

DISPARITY_UNIT = 5.0
"""Disparities, in px, are divided by this: one scale for all scenes, on which an error of 1 px still shows."""
AT_ONCE = 2
"""Fragments of a map, of 16 after two poolings, that go on together."""
Pool = Callable[[Tensor], Tensor]
"""A way of pooling, ReLU included: (B, C, H, W) -> (a multiple of B, C, H // 2, W // 2)."""
_BITS = {torch.float32: torch.int32, torch.bfloat16: torch.int16}
"""The whole numbers of the same bits. Of numbers above 0 they have the same order, and those below 0 are below 0."""


class EvaluationNet(nn.Module):
    """The paper's evaluation-Net."""

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(1, 16, 3)
        self.conv2 = nn.Conv2d(16, 32, 3)
        self.conv3 = nn.Conv2d(32, 64, 3)
        self.conv4_gray = nn.Conv2d(64, 128, 3)
        self.conv4_disparity = nn.Conv2d(64, 128, 3, bias=False)
        self.fc = nn.Conv2d(128, 128, 4)
        self.out = nn.Conv2d(128, 2, 1)

    def forward(self, layers: Tensor) -> Tensor:
        """Return the logits of the patches whose top left corners lie 16 px apart.

        Args:
            layers: (B, 2, H, W), standardised gray and disparity in units of ``DISPARITY_UNIT``.

        Returns:
            (B, 2, (H - 94) // 16 + 1, (W - 94) // 16 + 1): of a patch only its first 94 rows and columns
            need to lie on the map.
        """
        gray, disparity = (self._early(half, (_plain_pool, _plain_pool)) for half in _halves(layers))
        return self._late(gray, disparity, _plain_pool)

    def dense(self, layers: Tensor, step: Literal[1, 2, 4] = 1) -> Tensor:
        """Return the log-odds that the disparity is right, for the patches of one pair of maps.

        Args:
            layers: (1, 2, H, W), as for ``forward``.
            step: pixels from one patch to the next.

        Returns:
            float32 (y, x), at the patches' top left corners: every ``step``-th of the H - 100 by W - 100 patches that
            lie on the maps, and the next one where these do not end with one, so that all lie between answers.
        """
        pools = {1: (fragments, fragments), 2: (_plain_pool, fragments), 4: (_plain_pool, _plain_pool)}[step]
        gray, disparity = (torch.split(self._early(half, pools), AT_ONCE) for half in _halves(layers))
        # From here on no fragment meets another: a few at a time bound the memory.
        parts = [self._late(*pair, fragments).float() for pair in zip(gray, disparity, strict=True)]
        logits = torch.cat([part.reshape(STRIDE, -1, *part.shape[1:]) for part in parts], 1).flatten(0, 1)
        height, width = (-(-(length - PATCH) // step) + 1 for length in layers.shape[2:])
        return interleave(logits[:, 1] - logits[:, 0])[:height, :width]

    def _early(self, maps: Tensor, pools: tuple[Pool, Pool]) -> Tensor:
        """Return the first two convolutions of one layer: (B, 1, H, W) -> (B, 4 B or 16 B, 32, ...)."""
        for conv, pool in zip((self.conv1, self.conv2), pools, strict=True):
            maps = pool(conv(maps))
        return maps

    def _late(self, gray: Tensor, disparity: Tensor, pool: Pool) -> Tensor:
        """Return the logits from what ``_early`` made of the two layers."""
        gray, disparity = (pool(self.conv3(maps)) for maps in (gray, disparity))
        return self._head(pool(self.conv4_gray(gray) + self.conv4_disparity(disparity)))

    def _head(self, features: Tensor) -> Tensor:
        logits: Tensor = self.out(functional.relu(self.fc(features)))
        return logits


def evaluation_net_from_parameters(parameters: NDArray[np.float32]) -> EvaluationNet:
    """Return the network that a vector of parameters, as ``to_vector`` makes them, belongs to, ready for inference.

    It is built once for all tiles of a map, so nobody may change it.
    """
    return _built(np.ascontiguousarray(parameters, np.float32).tobytes())


@lru_cache(maxsize=2)
def _built(parameters: bytes) -> EvaluationNet:
    net = unset(EvaluationNet)
    from_vector(net, np.frombuffer(parameters, np.float32))
    return net.to(memory_format=torch.channels_last)  # type: ignore[call-overload, no-any-return]


def _halves(layers: Tensor) -> tuple[Tensor, Tensor]:
    """Return the two input layers, each (B, 1, H, W)."""
    return layers[:, :1], layers[:, 1:]


def _plain_pool(maps: Tensor) -> Tensor:
    return functional.relu(functional.max_pool2d(maps, 2))  # the same as pooling last, on a quarter of the values


def fragments(maps: Tensor) -> Tensor:
    """Pool 2 x 2 at the four offsets (0, 0), (0, 1), (1, 0), (1, 1), and cut at 0.

    Args:
        maps: (B, C, H, W) float32 or bfloat16, without gradients.

    Returns:
        (4 B, C, H // 2, W // 2), the four offsets one after another. At an even size, the last row and
        column of the shifted fragments are made of one repeated row and column; ``dense`` cuts them off.
    """
    batch, channels, height, width = maps.shape
    bits = maps.permute(0, 2, 3, 1).contiguous().view(_BITS[maps.dtype])
    made = torch.empty((2, 2, batch, height // 2, width // 2, channels), dtype=bits.dtype)
    _pool(bits.numpy(), made.numpy())
    return made.view(maps.dtype).flatten(0, 2).permute(0, 3, 1, 2)


@kernel
def _pool(maps: NDArray[Any], made: NDArray[Any]) -> None:
    """Write the four fragments of maps (B, H, W, C), both as whole numbers of the same bits."""
    batch, height, width, channels = maps.shape
    columns = np.empty((width + 1) * channels, maps.dtype)  # the larger of two rows
    for each in range(batch):
        for y in range(2 * (height // 2)):
            upper, lower = maps[each, y].reshape(-1), maps[each, min(y + 1, height - 1)].reshape(-1)
            for k in range(width * channels):
                columns[k] = max(upper[k], lower[k])
            for c in range(channels):
                columns[width * channels + c] = columns[(width - 1) * channels + c]
            for x in range(2 * (width // 2)):
                out = made[y % 2, x % 2, each, y // 2, x // 2]
                one, two = columns[x * channels :], columns[(x + 1) * channels :]
                for c in range(channels):
                    out[c] = max(max(one[c], two[c]), 0)


def interleave(values: Tensor) -> Tensor:
    """Undo rounds of ``fragments``: (4 ** n, H, W) -> (2 ** n H, 2 ** n W).

    The offsets of the last pooling come first in the batch and weigh most.
    """
    while len(values) > 1:
        count, height, width = values.shape
        offsets = values.reshape(2, 2, count // 4, height, width).permute(2, 3, 0, 4, 1)
        values = offsets.reshape(count // 4, 2 * height, 2 * width)
    return values[0]
