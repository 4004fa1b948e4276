"""conv3 and the compact head in the transformed domain (see ``winograd``): the same numbers by fewer products.

Transforms are in float32. Embedded views and what is multiplied lie in memory as float32 or, for speed, as bfloat16;
then so does what comes of a product.

A block of cells at one disparity goes through

    join       add two embedded views, cut at zero, transform 6 x 6 tiles        (tile, 36, 128) a channel
    product    with conv3's transformed kernels, summed over the channels         (36, tile, 64)
    features   transform back, add the bias, cut at zero                          (y, x, 64)
    split      transform 8 x 8 tiles                                              (tile, 64, 64)
    product    with the hidden layer's transformed kernels                        (64, tile, 128)
    units      transform back, add the bias, cut at zero                          (y, x, 128)

What goes into a product is written tile by tile, while the tile is in the cache; what comes out of it lies as
batched matrix products write fastest. The channels of a number are side by side in both. How many there are is a
constant in each kernel: only then does the compiler know that no index is negative, and make vector instructions.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from semidense.stages.compute.kernel import inlined, kernel
from semidense.stages.matching.net import MatchingNet
from semidense.stages.matching.winograd.storage import Flat, Stored, flat, stored
from semidense.stages.matching.winograd.tiles import (
    TILE,
    forward6,
    forward8,
    gather6,
    gather8,
    inverse6,
    inverse8,
    load6,
    load8,
    pick6,
    pick8,
    spread,
    store4,
    store6,
    store8,
)

JOINED = 128
"""Filters of conv2, for each of the channels."""
FEATURES = 64
"""Filters of conv3."""
UNITS = 128
"""Units of the hidden layer."""
ZERO = np.float32(0)

Shape = tuple[int, int]
"""Rows and columns of tiles."""
Corners = tuple[int, int, int]
"""First row of a block, and its first column in the left and in the right view."""


@kernel
def join(left: Stored, right: Stored, corners: Corners, shape: Shape, tiles: Stored) -> None:
    """Add two views of one channel (y, x, JOINED), cut at zero, and transform 6 x 6 tiles that lie 4 px apart.

    ``tiles``: (tile, 36, JOINED).
    """
    row = 6 * JOINED
    part = np.empty(6 * 6 * JOINED, np.float32)  # one tile, transformed along its rows: fits the first-level cache
    ones, others = left.reshape(-1), right.reshape(-1)
    for tile in range(shape[0] * shape[1]):
        y, x = corners[0] + tile // shape[1] * TILE, tile % shape[1] * TILE
        for k in range(6):
            first = ((y + k) * left.shape[1] + corners[1] + x) * JOINED
            second = ((y + k) * right.shape[1] + corners[2] + x) * JOINED
            line = part[k * row : (k + 1) * row]
            _join_row(ones[first : first + row], others[second : second + row], line)
        out = tiles[tile * 6 * row : (tile + 1) * 6 * row]
        for c in range(6 * JOINED):
            store6(out, 6 * JOINED, c, forward6(load6(part, 6 * JOINED, c)))


@inlined
def _join_row(one: Stored, other: Stored, out: Flat) -> None:
    """Add and cut six pixels, and transform along the row."""
    for c in range(JOINED):
        p, q = load6(one, JOINED, c), load6(other, JOINED, c)
        joined = (
            max(p[0] + q[0], ZERO),
            max(p[1] + q[1], ZERO),
            max(p[2] + q[2], ZERO),
            max(p[3] + q[3], ZERO),
            max(p[4] + q[4], ZERO),
            max(p[5] + q[5], ZERO),
        )
        store6(out, JOINED, c, forward6(joined))


@kernel
def features(products: Stored, bias: Flat, shape: Shape, out: Flat) -> None:
    """Transform conv3's products (36, tile, FEATURES) back, add the bias, cut at zero: (4 y, 4 x, FEATURES)."""
    row = 6 * FEATURES
    part = np.empty(TILE * 6 * FEATURES, np.float32)
    for tile in range(shape[0] * shape[1]):
        for j in range(6):
            numbers, column = gather6(products, j, tile), part[j * FEATURES :]
            for c in range(FEATURES):
                store4(column, 6 * FEATURES, c, inverse6(pick6(numbers, c)))
        for k in range(TILE):
            line, pixels = part[k * row : (k + 1) * row], four_pixels(out, tile, k, shape, FEATURES)
            for c in range(FEATURES):
                store4(pixels, FEATURES, c, _biased(inverse6(load6(line, FEATURES, c)), bias[c]))


@kernel
def split(given: Flat, shape: Shape, tiles: Stored) -> None:
    """Transform 8 x 8 tiles, 4 px apart, of features (4 y + 4, 4 x + 4, FEATURES): (tile, 64, FEATURES)."""
    row = 8 * FEATURES
    part = np.empty(8 * 8 * FEATURES, np.float32)
    for tile in range(shape[0] * shape[1]):
        for k in range(8):
            place = eight_pixels(tile, k, shape)
            pixels, line = given[place : place + row], part[k * row : (k + 1) * row]
            for c in range(FEATURES):
                store8(line, FEATURES, c, forward8(load8(pixels, FEATURES, c)))
        out = tiles[tile * 8 * row : (tile + 1) * 8 * row]
        for c in range(8 * FEATURES):
            store8(out, 8 * FEATURES, c, forward8(load8(part, 8 * FEATURES, c)))


@kernel
def units(products: Stored, bias: Flat, shape: Shape, out: Flat) -> None:
    """Transform the hidden layer's products (64, tile, UNITS) back, add the bias, cut at zero: (4 y, 4 x, UNITS)."""
    row = 8 * UNITS
    part = np.empty(TILE * 8 * UNITS, np.float32)
    for tile in range(shape[0] * shape[1]):
        for j in range(8):
            numbers, column = gather8(products, j, tile), part[j * UNITS :]
            for c in range(UNITS):
                store4(column, 8 * UNITS, c, inverse8(pick8(numbers, c)))
        for k in range(TILE):
            line, pixels = part[k * row : (k + 1) * row], four_pixels(out, tile, k, shape, UNITS)
            for c in range(UNITS):
                store4(pixels, UNITS, c, _biased(inverse8(load8(line, UNITS, c)), bias[c]))


@inlined
def four_pixels(maps: Flat, tile: int, row: int, shape: Shape, channels: int) -> Flat:
    """Return the four pixels of a map (4 y, 4 x, channels) that are row ``row`` of a tile."""
    place = ((tile // shape[1] * TILE + row) * shape[1] + tile % shape[1]) * TILE * channels
    return maps[place : place + TILE * channels]


@inlined
def eight_pixels(tile: int, row: int, shape: Shape) -> int:
    """Return where in a map (4 y + 4, 4 x + 4, FEATURES) row ``row`` of an 8 x 8 tile begins."""
    return ((tile // shape[1] * TILE + row) * (shape[1] + 1) + tile % shape[1]) * TILE * FEATURES


@inlined
def _biased(
    v: tuple[np.float32, np.float32, np.float32, np.float32], bias: np.float32
) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    return max(v[0] + bias, ZERO), max(v[1] + bias, ZERO), max(v[2] + bias, ZERO), max(v[3] + bias, ZERO)


def is_transformable(net: MatchingNet) -> bool:
    """Return whether this module computes what the network does: that of the compact head."""
    return net.head == "compact"


@dataclass(frozen=True)
class TransformedNet:
    """conv3 and the hidden layer of a network with the compact head."""

    conv3: Tensor  # l 36 JOINED FEATURES
    conv3_bias: Tensor  # FEATURES
    hidden: Tensor  # 64 FEATURES UNITS
    hidden_bias: Tensor  # UNITS

    @classmethod
    def of(cls, net: MatchingNet, dtype: torch.dtype = torch.float32) -> "TransformedNet":
        """Transform a network's kernels; gradients flow back to them.

        Args:
            net: with the compact head.
            dtype: of what is multiplied, float32 or bfloat16.
        """
        parameters = dict(net.named_parameters())
        parts = parameters["conv3.weight"].split(JOINED, 1)  # type: ignore[no-untyped-call]
        return cls(
            torch.stack([spread(part) for part in parts]).to(dtype),
            parameters["conv3.bias"],
            spread(parameters["hidden.0.weight"]).to(dtype),
            parameters["hidden.0.bias"],
        )


@dataclass(frozen=True)
class Blocks:
    """The maps of blocks of cells that a gradient needs again."""

    features: Tensor  # block 4 y + 4, 4 x + 4, FEATURES; float32
    split: Tensor  # block tile 64 FEATURES; of the dtype that is multiplied
    units: Tensor  # block 4 y, 4 x, UNITS; float32


def run_blocks(net: TransformedNet, left: Tensor, right: Tensor, corners: Sequence[Corners], shape: Shape) -> Blocks:
    """Run blocks of cells, each at one disparity; small ones together, since large products are quicker.

    Args:
        net: the transformed kernels.
        left: (l, y, x, JOINED) float32 or bfloat16 as the kernels, contiguous: the embedded left view.
        right: likewise the right view.
        corners: of each block; 6 rows and columns more than it has cells are read from there.
        shape: rows and columns of a block, in tiles of 4 x 4 cells.
    """
    wide = shape[0] + 1, shape[1] + 1  # the hidden layer reaches 4 px on
    count = len(corners)
    joined = torch.empty(count, wide[0] * wide[1], 36, JOINED, dtype=net.conv3.dtype)
    products = torch.zeros(36, count * wide[0] * wide[1], FEATURES, dtype=net.conv3.dtype)
    for one, other, weight in zip(left, right, net.conv3, strict=True):
        for at, block in zip(corners, joined, strict=True):
            join(stored(one), stored(other), at, wide, stored(block.view(-1)))
        products.baddbmm_(joined.flatten(0, 1).transpose(0, 1), weight)
    maps = torch.empty(count, TILE * wide[0], TILE * wide[1], FEATURES)
    features(stored(products), net.conv3_bias.numpy(), (count * wide[0], wide[1]), flat(maps))
    tiles = torch.empty(count, shape[0] * shape[1], 64, FEATURES, dtype=net.hidden.dtype)
    for block, one in zip(maps, tiles, strict=True):
        split(flat(block), shape, stored(one.view(-1)))
    answers = torch.bmm(tiles.flatten(0, 1).transpose(0, 1), net.hidden)
    made = torch.empty(count, TILE * shape[0], TILE * shape[1], UNITS)
    units(stored(answers), net.hidden_bias.numpy(), (count * shape[0], shape[1]), flat(made))
    return Blocks(maps, tiles, made)
