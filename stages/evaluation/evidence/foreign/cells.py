"""Our costs of a map that another matcher made: of the cells at and beside its disparities, and of no other."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.compute.precision import Precision
from semidense.stages.compute.threads import one_thread
from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.matching.declaration import REACH
from semidense.stages.matching.descriptors.net import descriptor_net_from_parameters
from semidense.stages.matching.descriptors.view import described_views
from semidense.stages.stage import Network

OFFSETS = range(-2, 4)
"""Cells of a pixel: whole disparities from 2 px below the one at or below its own to 3 px above it."""
CONTEXT = 12
"""Pixels around a block that costs are told of: as far as the largest window reaches that they are averaged over."""
_CUT = RADIUS - CONTEXT


@dataclass(frozen=True)
class Described:
    """Both views of a block with 50 px of context all round, as descriptors: whatever its map, they are the same.

    Attributes:
        left: (y + 24, x + 24, filter) float32 of unit length: the block with ``CONTEXT``.
        right: the same of the right view.
        scale: log-odds of a mismatch by which a dot product of 1 is lower than one of 0.
        bias: log-odds of a dot product of 0.
    """

    left: NDArray[np.float32]
    right: NDArray[np.float32]
    scale: float
    bias: float

    def costs(self, disparity: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the log-odds of a mismatch in the cells of each pixel of a map.

        Args:
            disparity: (y + 100, x + 100) float32, px; NaN: none.

        Returns:
            (cell, y + 100, x + 100) float32, a cell for each of ``OFFSETS``; NaN where there is no disparity, where the
            right pixel is outside the image, and beyond ``CONTEXT``.
        """
        made = np.full((len(OFFSETS), *disparity.shape), np.nan, np.float32)
        inner = np.ascontiguousarray(disparity[_CUT:-_CUT, _CUT:-_CUT])
        products = np.full((len(OFFSETS), *inner.shape), np.nan, np.float32)
        _write_products(self.left, self.right, inner, OFFSETS[0], CONTEXT, inner.shape[1] - CONTEXT, products)
        made[:, _CUT:-_CUT, _CUT:-_CUT] = np.float32(self.bias) - np.float32(self.scale) * products
        return made


@one_thread()
def described(channels: NDArray[np.float32], descriptor_net: Network, precision: Precision) -> Described:
    """Return the descriptors of both views.

    Args:
        channels: (view, channel, y + 100, x + 100) float32.
        descriptor_net: ``parameters``.
        precision: arithmetic of the convolutions; the products of descriptors are float32.

    Raises:
        StageError: if the channels do not fit the network.
    """
    net = descriptor_net_from_parameters(descriptor_net["parameters"], channels.shape[1])
    with torch.inference_mode():
        beyond = _CUT - REACH  # the net takes what a descriptor sees
        left, right = described_views(net, channels[..., beyond:-beyond, beyond:-beyond], precision)
        return Described(left.numpy(), right.numpy(), float(net.log_scale.exp()), float(net.bias))


@kernel
def _write_products(
    left: NDArray[np.float32],
    right: NDArray[np.float32],
    disparity: NDArray[np.float32],
    lowest: int,
    first: int,
    end: int,
    made: NDArray[np.float32],
) -> None:
    """Write the dot product of the two descriptors of each cell."""
    height, width = disparity.shape
    for y in range(height):
        for x in range(width):
            if np.isnan(disparity[y, x]):
                continue
            base = int(np.floor(disparity[y, x])) + lowest
            for cell in range(len(made)):
                seen = x - base - cell
                if first <= seen < end:
                    total = np.float32(0)
                    for k in range(left.shape[2]):
                        total += left[y, x, k] * right[y, seen, k]
                    made[cell, y, x] = total
