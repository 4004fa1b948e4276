"""Gradients through the descriptor-Net's transformed layers: each linear step's transpose, as for the matching-Net.

The transformed tiles of a layer are made again, which is cheaper than to keep them.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semidense.stages.compute.kernel import inlined, kernel
from semidense.stages.compute.precision import Precision
from semidense.stages.matching.descriptors.net import DescriptorNet
from semidense.stages.matching.descriptors.transformed import (
    TILES,
    WIDEST,
    convolved,
    corner,
    kernels_of,
    six_pixels,
    split,
    transformed_descriptors,
)
from semidense.stages.matching.winograd.storage import Flat
from semidense.stages.matching.winograd.tiles import (
    TILE,
    Four,
    forward6_transposed,
    gather6,
    inverse6_transposed,
    load4,
    load6,
    pick6,
    store6,
)


@kernel
def _merge_transposed(gradient: NDArray[np.float32], first: int, count: int, step: int, products: Flat) -> None:
    """Carry the gradient of a layer's answers (y, x, filter) to its products (tile, 36, filter)."""
    width = gradient.shape[2]
    row = 6 * WIDEST
    part = np.empty(TILE * row, np.float32)
    for tile in range(count):
        y, x = corner(first + tile, step, gradient.shape[1])
        for k in range(TILE):
            pixels, line = _four_pixels(gradient, y + k * step, x, step), part[k * row : (k + 1) * row]
            for c in range(width):
                four = pixels[0][c], pixels[1][c], pixels[2][c], pixels[3][c]
                store6(line, WIDEST, c, inverse6_transposed(four))
        for j in range(6):
            column, out = part[j * WIDEST :], products[(tile * 36 + j) * width :]
            for c in range(width):
                store6(out, 6 * width, c, inverse6_transposed(load4(column, row, c)))


@inlined
def _four_pixels(maps: NDArray[np.float32], y: int, x: int, step: int) -> Four[Flat]:
    """Return the channels of four pixels of a row, ``step`` px apart."""
    return maps[y, x], maps[y, x + step], maps[y, x + 2 * step], maps[y, x + 3 * step]


@kernel
def _split_transposed(tiles: NDArray[np.float32], first: int, step: int, gradient: NDArray[np.float32]) -> None:
    """Add up the gradients of tiles (36, tile, filter) in that of a layer's maps (y, x, filter)."""
    width = tiles.shape[2]
    row = 6 * WIDEST
    part = np.empty(6 * row, np.float32)
    for tile in range(tiles.shape[1]):
        for j in range(6):
            numbers, column = gather6(tiles, j, tile), part[j * WIDEST :]
            for c in range(width):
                store6(column, row, c, forward6_transposed(pick6(numbers, c)))
        y, x = corner(first + tile, step, gradient.shape[1] - 2 * step)
        for k in range(6):
            line, pixels = part[k * row : (k + 1) * row], six_pixels(gradient, y + k * step, x, step)
            for c in range(width):
                six = forward6_transposed(load6(line, WIDEST, c))
                pixels[0][c] += six[0]
                pixels[1][c] += six[1]
                pixels[2][c] += six[2]
                pixels[3][c] += six[3]
                pixels[4][c] += six[4]
                pixels[5][c] += six[5]


def describer(net: DescriptorNet, precision: Precision) -> Callable[[Tensor], Tensor]:
    """Return what gives a view (1, channel, y + 16, x + 16) its descriptors (y, x, filter), differentiable."""
    if precision != "float32":
        return lambda view: net(view)[0].permute(1, 2, 0)
    kernels = kernels_of(net)
    return lambda view: transformed_descriptors(net, kernels, view[0], differentiable)


def differentiable(maps: Tensor, weight: Tensor, bias: Tensor, floor: float, step: int) -> Tensor:
    """As ``convolved``; gradients flow back to maps, weight and bias."""
    made: Tensor = _Convolved.apply(maps, weight, bias, floor, step)  # type: ignore[no-untyped-call]
    return made


class _Convolved(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, maps: Tensor, weight: Tensor, bias: Tensor, floor: float, step: int) -> Tensor:  # noqa: ANN401
        made = convolved(maps, weight, bias, floor, step)
        ctx.save_for_backward(maps, weight, made)
        ctx.floor, ctx.step = floor, step
        return made

    @staticmethod
    def backward(ctx: Any, given: Tensor) -> tuple[Tensor | None, ...]:  # noqa: ANN401
        maps, weight, made = ctx.saved_tensors
        given = (given * (made > ctx.floor)).contiguous()
        maps_gradient, weight_gradient = torch.zeros_like(maps), torch.zeros_like(weight)
        total = made.shape[0] * made.shape[1] // TILE**2
        width = maps.shape[2]
        tiles, products = torch.empty(36, TILES, width), torch.empty(TILES, 36, width)
        for first in range(0, total, TILES):
            count = min(TILES, total - first)
            split(maps.numpy(), first, count, ctx.step, tiles.numpy())
            _merge_transposed(given.numpy(), first, count, ctx.step, products.view(-1).numpy())
            answers = products[:count].transpose(0, 1)
            weight_gradient.baddbmm_(tiles[:, :count].transpose(1, 2), answers)
            back = torch.bmm(answers, weight.transpose(1, 2))
            _split_transposed(back.numpy(), first, ctx.step, maps_gradient.numpy())
        return maps_gradient, weight_gradient, given.sum((0, 1)), None, None
