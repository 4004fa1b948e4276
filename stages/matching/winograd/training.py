"""Gradients through conv3 and the compact head in the transformed domain.

Every step of ``winograd.volume`` but the ReLUs is linear, so its gradient is its transpose: transforms are transposed,
products become products with the transposed kernels, tiles that overlapped are added up. What is cheap to make
again (the joined views) is not kept.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semidense.stages.compute.kernel import inlined, kernel
from semidense.stages.matching.winograd.storage import Flat, flat
from semidense.stages.matching.winograd.tiles import (
    TILE,
    forward6_transposed,
    forward8_transposed,
    gather6,
    gather8,
    inverse6_transposed,
    inverse8_transposed,
    load4,
    load6,
    load8,
    pick6,
    pick8,
    store6,
    store8,
)
from semidense.stages.matching.winograd.volume import (
    FEATURES,
    JOINED,
    UNITS,
    ZERO,
    Blocks,
    Shape,
    TransformedNet,
    eight_pixels,
    four_pixels,
    join,
    run_blocks,
)

TOGETHER = 192
"""Tiles of a crop's slots whose products are made at once: what is in between still stays in the processor's cache."""


@kernel
def _units_transposed(gradient: Flat, shape: Shape, products: Flat) -> None:
    """Carry the gradient of the units (4 y, 4 x, UNITS) to the products (tile, 64, UNITS)."""
    row = 8 * UNITS
    part = np.empty(TILE * 8 * UNITS, np.float32)
    for tile in range(shape[0] * shape[1]):
        for k in range(TILE):
            line, pixels = part[k * row : (k + 1) * row], four_pixels(gradient, tile, k, shape, UNITS)
            for c in range(UNITS):
                store8(line, UNITS, c, inverse8_transposed(load4(pixels, UNITS, c)))
        out = products[tile * 8 * row : (tile + 1) * 8 * row]
        for c in range(8 * UNITS):
            store8(out, 8 * UNITS, c, inverse8_transposed(load4(part, 8 * UNITS, c)))


@kernel
def _split_transposed(tiles: NDArray[np.float32], shape: Shape, gradient: Flat) -> None:
    """Add up the gradients of tiles (64, tile, FEATURES) in that of the features (4 y + 4, 4 x + 4, FEATURES)."""
    row = 8 * FEATURES
    part = np.empty(8 * 8 * FEATURES, np.float32)
    for tile in range(shape[0] * shape[1]):
        for j in range(8):
            numbers, column = gather8(tiles, j, tile), part[j * FEATURES :]
            for c in range(FEATURES):
                store8(column, 8 * FEATURES, c, forward8_transposed(pick8(numbers, c)))
        for k in range(8):
            place = eight_pixels(tile, k, shape)
            line, pixels = part[k * row : (k + 1) * row], gradient[place : place + row]
            for c in range(FEATURES):
                store8(line, FEATURES, c, forward8_transposed(load8(line, FEATURES, c)))
            for c in range(8 * FEATURES):
                pixels[c] += line[c]


@kernel
def _features_transposed(gradient: Flat, shape: Shape, products: Flat) -> None:
    """Carry the gradient of the features (4 y, 4 x, FEATURES) to the products (tile, 36, FEATURES)."""
    row = 6 * FEATURES
    part = np.empty(TILE * 6 * FEATURES, np.float32)
    for tile in range(shape[0] * shape[1]):
        for k in range(TILE):
            line, pixels = part[k * row : (k + 1) * row], four_pixels(gradient, tile, k, shape, FEATURES)
            for c in range(FEATURES):
                store6(line, FEATURES, c, inverse6_transposed(load4(pixels, FEATURES, c)))
        out = products[tile * 6 * row : (tile + 1) * 6 * row]
        for c in range(6 * FEATURES):
            store6(out, 6 * FEATURES, c, inverse6_transposed(load4(part, 6 * FEATURES, c)))


@kernel
def _join_transposed(
    tiles: NDArray[np.float32],
    views: tuple[NDArray[np.float32], NDArray[np.float32]],
    start: int,
    shape: Shape,
    gradients: tuple[NDArray[np.float32], NDArray[np.float32]],
) -> None:
    """Add up the gradients of tiles (36, tile, JOINED) in those of the two views of one channel (y, x, JOINED)."""
    row = 6 * JOINED
    part = np.empty(6 * 6 * JOINED, np.float32)
    left, right = views[0].reshape(-1), views[1].reshape(-1)
    left_gradient, right_gradient = gradients[0].reshape(-1), gradients[1].reshape(-1)
    for tile in range(shape[0] * shape[1]):
        for j in range(6):
            numbers, column = gather6(tiles, j, tile), part[j * JOINED :]
            for c in range(JOINED):
                store6(column, 6 * JOINED, c, forward6_transposed(pick6(numbers, c)))
        for k in range(6):
            y, x = tile // shape[1] * TILE + k, tile % shape[1] * TILE
            first = (y * views[0].shape[1] + x) * JOINED
            second = (y * views[1].shape[1] + start + x) * JOINED
            line = part[k * row : (k + 1) * row]
            for c in range(JOINED):
                store6(line, JOINED, c, forward6_transposed(load6(line, JOINED, c)))
            _cut(line, left[first : first + row], right[second : second + row])
            _add(line, left_gradient[first : first + row])
            _add(line, right_gradient[second : second + row])


@inlined
def _cut(gradient: Flat, one: Flat, other: Flat) -> None:
    """Let no gradient through where the sum of the views was cut."""
    for c in range(6 * JOINED):
        gradient[c] = gradient[c] if one[c] + other[c] > ZERO else ZERO


@inlined
def _add(line: Flat, total: Flat) -> None:
    for c in range(6 * JOINED):
        total[c] += line[c]


def joined_units(left: Tensor, strip: Tensor, starts: Sequence[int], net: TransformedNet) -> Tensor:
    """Return the hidden layer's units of a crop at each disparity; gradients flow back to all that is given.

    Args:
        left: (l, y + 6, x + 6, JOINED) float32, contiguous: the embedded left crop, y and x multiples of 4.
        strip: (l, y + 6, x + 6 + span, JOINED) float32, contiguous: the embedded strip of the right view.
        starts: the column of the strip at which each slot begins.
        net: the transformed kernels.

    Returns:
        float32 (slot, y, x, UNITS), not negative.
    """
    units: Tensor = _JoinedUnits.apply(  # type: ignore[no-untyped-call]
        left, strip, starts, net.conv3, net.conv3_bias, net.hidden, net.hidden_bias
    )
    return units


class _JoinedUnits(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, left: Tensor, strip: Tensor, starts: Sequence[int], *kernels: Tensor) -> Tensor:  # noqa: ANN401
        net, shape = TransformedNet(*kernels), _tiles(left)
        several = max(1, TOGETHER // (shape[0] * shape[1]))
        groups = [starts[first : first + several] for first in range(0, len(starts), several)]
        made = [run_blocks(net, left, strip, [(0, 0, start) for start in group], shape) for group in groups]
        ctx.views, ctx.net, ctx.groups, ctx.made = (left, strip), net, groups, made
        return torch.cat([blocks.units for blocks in made])

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:  # noqa: ANN401
        views, net = ctx.views, ctx.net
        totals = tuple(torch.zeros_like(view) for view in views)
        kernels = [torch.zeros_like(part) for part in (net.conv3, net.conv3_bias, net.hidden, net.hidden_bias)]
        given = torch.split(gradient, [len(group) for group in ctx.groups])
        for group, blocks, part in zip(ctx.groups, ctx.made, given, strict=True):
            products = _products_gradient(net, blocks, part, kernels)
            _views_gradient(net, views, group, products, totals, kernels[0])
        ctx.made = None
        return (*totals, None, *kernels)


def _tiles(left: Tensor) -> Shape:
    return (left.shape[1] - 6) // TILE, (left.shape[2] - 6) // TILE


def _products_gradient(net: TransformedNet, blocks: Blocks, given: Tensor, kernels: Sequence[Tensor]) -> Tensor:
    """Return the gradient of conv3's products from that of the units; add up those of the kernels on the way."""
    _, conv3_bias, hidden, hidden_bias = kernels
    count, shape = len(given), (given.shape[1] // TILE, given.shape[2] // TILE)
    cut = given * (blocks.units > 0)
    hidden_bias += cut.sum((0, 1, 2))
    answers = torch.empty(count * shape[0] * shape[1], 64, UNITS)
    _units_transposed(flat(cut), (count * shape[0], shape[1]), flat(answers))
    hidden.baddbmm_(blocks.split.flatten(0, 1).permute(1, 2, 0), answers.transpose(0, 1))
    tiles = torch.bmm(answers.transpose(0, 1), net.hidden.transpose(1, 2))
    maps = torch.zeros_like(blocks.features)
    for block, one in zip(maps, tiles.chunk(count, 1), strict=True):
        _split_transposed(one.numpy(), shape, flat(block))
    maps *= blocks.features > 0
    conv3_bias += maps.sum((0, 1, 2))
    wide = shape[0] + 1, shape[1] + 1
    products = torch.empty(count * wide[0] * wide[1], 36, FEATURES)
    _features_transposed(flat(maps), (count * wide[0], wide[1]), flat(products))
    return products


def _views_gradient(
    net: TransformedNet,
    views: tuple[Tensor, Tensor],
    starts: Sequence[int],
    products: Tensor,
    totals: tuple[Tensor, ...],
    conv3: Tensor,
) -> None:
    """Add up the gradients of the views and of conv3's kernels from that of its products."""
    rows, columns = _tiles(views[0])
    wide = rows + 1, columns + 1
    tiles = torch.empty(len(starts), wide[0] * wide[1], 36, JOINED)
    for layer, weight in enumerate(net.conv3):
        one, other = (view[layer].numpy() for view in views)
        for start, block in zip(starts, tiles, strict=True):
            join(one, other, (0, 0, start), wide, flat(block))
        conv3[layer].baddbmm_(tiles.flatten(0, 1).permute(1, 2, 0), products.transpose(0, 1))
        given = torch.bmm(products.transpose(0, 1), weight.transpose(1, 2))
        gradients = totals[0][layer].numpy(), totals[1][layer].numpy()
        for start, part in zip(starts, given.chunk(len(starts), 1), strict=True):
            _join_transposed(part.numpy(), (one, other), start, wide, gradients)
