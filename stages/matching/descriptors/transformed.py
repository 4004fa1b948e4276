"""The descriptor-Net in the transformed domain (see ``winograd``): the same numbers by a quarter of the products.

A kernel whose taps lie s px apart treats every s-th pixel of every s-th row as an image of its own; a tile is four
rows and columns of such an image, and so are the pixels that it answers. From layer to layer

    split      transform 6 x 6 tiles, s px between their pixels                  (36, tile, filter)
    product    with the layer's transformed kernels                              (36, tile, filter)
    merge      transform back, add the bias, cut at a floor                      (y, x, filter)

for some tiles at a time, so that they stay in the processor's cache. A number's tiles lie side by side, as the product
takes them: of another order it would make a copy first. The first layer has too few channels to gain.
All of it is float32.
"""

import math
from collections.abc import Callable, Sequence
from typing import get_args

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from semidense.stages.compute.kernel import inlined, kernel
from semidense.stages.matching.declaration import DILATIONS, REACH
from semidense.stages.matching.descriptors.declaration import Width
from semidense.stages.matching.descriptors.net import DescriptorNet
from semidense.stages.matching.winograd.storage import Flat
from semidense.stages.matching.winograd.tiles import (
    TILE,
    Four,
    Six,
    forward6,
    gather6,
    inverse6,
    load6,
    pick6,
    place6,
    spread,
    store4,
    store6,
)

WHOLE = TILE * max(DILATIONS)
"""Rows and columns of descriptors are made up to a multiple of this: then every layer has whole tiles."""
TILES = 96
"""Tiles that are transformed at once."""
WIDEST = max(get_args(Width))
"""Filters that a half transformed tile has room for, whatever it has: a loop is quicker with a fixed step."""

Corner = tuple[int, int]
Layer = Callable[[Tensor, Tensor, Tensor, float, int], Tensor]
"""``layer(maps, weight, bias, floor, step)``, as ``convolved``."""


@inlined
def corner(tile: int, step: int, width: int) -> Corner:
    """Return the first pixel that a tile answers; ``width``: columns of all answers."""
    tiles = width // TILE
    row, column = tile // tiles, tile % tiles
    return row // step * TILE * step + row % step, column // step * TILE * step + column % step


@inlined
def six_pixels(maps: NDArray[np.float32], y: int, x: int, step: int) -> Six[NDArray[np.float32]]:
    """Return the channels of six pixels of a row, ``step`` px apart."""
    return (
        maps[y, x],
        maps[y, x + step],
        maps[y, x + 2 * step],
        maps[y, x + 3 * step],
        maps[y, x + 4 * step],
        maps[y, x + 5 * step],
    )


@kernel
def split(maps: NDArray[np.float32], first: int, count: int, step: int, tiles: NDArray[np.float32]) -> None:
    """Transform ``count`` tiles of maps (y, x, filter) from tile ``first`` on, into (36, tile, filter)."""
    width = maps.shape[2]
    row = 6 * WIDEST
    part = np.empty(6 * row, np.float32)  # one tile, transformed along its rows
    for tile in range(count):
        y, x = corner(first + tile, step, maps.shape[1] - 2 * step)
        for k in range(6):
            pixels, line = six_pixels(maps, y + k * step, x, step), part[k * row : (k + 1) * row]
            for c in range(width):
                store6(line, WIDEST, c, forward6(pick6(pixels, c)))
        for j in range(6):
            column, out = part[j * WIDEST :], gather6(tiles, j, tile)
            for c in range(width):
                place6(out, c, forward6(load6(column, row, c)))


@kernel
def merge(
    products: NDArray[np.float32], bias: Flat, floor: np.float32, first: int, step: int, maps: NDArray[np.float32]
) -> None:
    """Transform products (36, tile, filter) back, add the bias, cut at the floor, into maps (y, x, filter)."""
    width = maps.shape[2]
    row = 6 * WIDEST
    part = np.empty(TILE * row, np.float32)
    for tile in range(products.shape[1]):
        for j in range(6):
            numbers, column = gather6(products, j, tile), part[j * WIDEST :]
            for c in range(width):
                store4(column, row, c, inverse6(pick6(numbers, c)))
        y, x = corner(first + tile, step, maps.shape[1])
        for k in range(TILE):
            line, below = part[k * row : (k + 1) * row], y + k * step
            one, two = maps[below, x], maps[below, x + step]
            three, four = maps[below, x + 2 * step], maps[below, x + 3 * step]
            for c in range(width):
                one[c], two[c], three[c], four[c] = _floored(inverse6(load6(line, WIDEST, c)), bias[c], floor)


@inlined
def _floored(v: Four[np.float32], bias: np.float32, floor: np.float32) -> Four[np.float32]:
    return max(v[0] + bias, floor), max(v[1] + bias, floor), max(v[2] + bias, floor), max(v[3] + bias, floor)


def kernels_of(net: DescriptorNet) -> list[Tensor]:
    """Return the kernels of every layer but the first in the transformed domain; gradients flow back to them."""
    return [spread(layer.weight) for layer in [*net.hidden[1:], net.out]]


def convolved(maps: Tensor, weight: Tensor, bias: Tensor, floor: float, step: int) -> Tensor:
    """Return what a layer makes of maps, cut at a floor: (y + 2 step, x + 2 step, filter) -> (y, x, filter).

    Args:
        maps: float32, contiguous; y and x multiples of 4 step.
        weight: (36, filter, filter), the transformed kernels.
        bias: (filter,).
        floor: 0 for a ReLU, minus infinity for none.
        step: distance of the kernels' taps, px.
    """
    width = maps.shape[2]
    made = torch.empty(maps.shape[0] - 2 * step, maps.shape[1] - 2 * step, width)
    total = made.shape[0] * made.shape[1] // TILE**2
    tiles = torch.empty(36, TILES, width)
    products = torch.empty(36 * TILES * width)
    for first in range(0, total, TILES):
        count = min(TILES, total - first)
        split(maps.numpy(), first, count, step, tiles.numpy())
        answers = products[: 36 * count * width].view(36, count, width)
        torch.bmm(tiles[:, :count], weight, out=answers)
        merge(answers.numpy(), bias.numpy(), np.float32(floor), first, step, made.numpy())
    return made


def transformed_descriptors(
    net: DescriptorNet, kernels: Sequence[Tensor], view: Tensor, layer: Layer = convolved
) -> Tensor:
    """Return the descriptors of a view, as the network makes them.

    Args:
        net: the network.
        kernels: of ``kernels_of``.
        view: float32 (channels, y + 16, x + 16).
        layer: ``convolved``, or one that gradients flow through.

    Returns:
        float32 (y, x, filter), of unit length.
    """
    height, width = (length - 2 * REACH for length in view.shape[1:])
    made_up = functional.pad(view[None], (0, -width % WHOLE, 0, -height % WHOLE))
    first = net.hidden[0](net.normalised(made_up.contiguous(memory_format=torch.channels_last)))
    maps = functional.relu(first[0].permute(1, 2, 0)).contiguous()
    for own, weight, step in zip([*net.hidden[1:], net.out], kernels, DILATIONS[1:], strict=True):
        maps = layer(maps, weight, own.bias, -math.inf if own is net.out else 0.0, step)
    return functional.normalize(maps[:height, :width], dim=2)
