"""The costs of single 4 x 4 tiles of cells, each at a disparity of its own: what the exact volume has there.

In the transformed domain (see ``winograd``) a tile of the hidden layer takes four tiles of conv3, and tiles side
by side at one disparity share them: those of a batch are made once each. With the paper's head each tile goes through
the network's own convolutions with all the context that it needs.
"""

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from semidense.stages.compute.kernel import kernel
from semidense.stages.compute.precision import Precision, autocast, dtype_of
from semidense.stages.matching.declaration import RADIUS
from semidense.stages.matching.net import SIDES, MatchingNet
from semidense.stages.matching.winograd.storage import Flat, Stored, flat, stored
from semidense.stages.matching.winograd.tiles import TILE, forward8, load4, load8, store8
from semidense.stages.matching.winograd.volume import (
    FEATURES,
    JOINED,
    UNITS,
    TransformedNet,
    features,
    is_transformable,
    join,
    units,
)

BATCH = 256
"""Tiles judged at once: few enough for all that is in between to stay in the processor's cache."""
REACH = TILE + 2 * RADIUS - 4
"""Rows and columns of the joined maps that a tile takes."""

Places = NDArray[np.int64]
"""(n, 3): row and column of a tile's first cell, disparity in px."""
Judge = Callable[[Places], NDArray[np.float32]]
"""``judge(places)``: the costs of tiles, (n, 4, 4). A cell whose right pixel is outside the image has any value."""


def judge_tiles(net: MatchingNet, views: Tensor, precision: Precision) -> Judge:
    """Return what gives the costs of tiles.

    Args:
        net: the matching-Net.
        views: (view, channel, y + 10, x + 10) float32, with 5 px of context on every side.
        precision: arithmetic of the convolutions.
    """
    # A tile at the border reaches past what exists by less than a tile: there its cells are invalid.
    left, right = (
        functional.pad(net.embed_layers(view[None], side), (TILE, TILE, 0, TILE)).permute(0, 2, 3, 1).contiguous()
        for view, side in zip(views, SIDES, strict=True)
    )
    return (_transformed if is_transformable(net) else _direct)(net, left, right, precision)


def _corners(places: Places) -> NDArray[np.int64]:
    """Return where tiles begin in the maps: row, column in the left and column in the right one."""
    return np.stack([places[:, 0], places[:, 1] + TILE, places[:, 1] - places[:, 2] + TILE], 1)


def _direct(net: MatchingNet, left: Tensor, right: Tensor, precision: Precision) -> Judge:
    """Judge by the network's own convolutions."""
    # y x l JOINED reach reach: every window of the maps, without a copy
    ones, others = (each.permute(1, 2, 0, 3).unfold(0, REACH, 1).unfold(1, REACH, 1) for each in (left, right))

    def judge(places: Places) -> NDArray[np.float32]:
        rows, first, second = torch.from_numpy(_corners(places)).T
        joined = functional.relu(ones[rows, first] + others[rows, second]).flatten(1, 2)
        with autocast(precision):
            made: NDArray[np.float32] = net.log_odds(joined.contiguous(memory_format=torch.channels_last)).numpy()
        return made

    return judge


def _transformed(net: MatchingNet, left: Tensor, right: Tensor, precision: Precision) -> Judge:
    """Judge by transformed convolutions."""
    dtype = dtype_of(precision)
    transformed, left, right = TransformedNet.of(net, dtype), left.to(dtype), right.to(dtype)

    def judge(places: Places) -> NDArray[np.float32]:
        needed, slots = _quarters(places)
        made = net.odds_of_features(_run(transformed, left, right, _corners(needed), slots))  # 4, 4 n
        answers: NDArray[np.float32] = made.view(TILE, len(places), TILE).transpose(0, 1).numpy()
        return answers

    return judge


def _quarters(places: Places) -> tuple[Places, NDArray[np.int64]]:
    """Return the tiles of conv3 that tiles of the hidden layer take, once each, and which of them are whose.

    The second is (n, 4): upper left, upper right, lower left, lower right.
    """
    steps = np.array([[0, 0, 0], [0, TILE, 0], [TILE, 0, 0], [TILE, TILE, 0]])
    wanted = (places[:, None] + steps).reshape(-1, 3)
    lowest = wanted.min(0)
    extent = wanted.max(0) - lowest + 1
    codes = np.ravel_multi_index(tuple((wanted - lowest)[:, [2, 0, 1]].T), tuple(extent[[2, 0, 1]]))
    _, first, inverse = np.unique(codes, return_index=True, return_inverse=True)
    return wanted[first], inverse.reshape(-1, 4)


def _run(
    net: TransformedNet, left: Tensor, right: Tensor, corners: NDArray[np.int64], slots: NDArray[np.int64]
) -> Tensor:
    """Return the units of the hidden layer, (4, 4 n, UNITS): as ``winograd.volume.run_blocks``, for any tiles."""
    count, tiles = len(corners), len(slots)
    joined = torch.empty(count, 36, JOINED, dtype=net.conv3.dtype)
    products = torch.zeros(36, count, FEATURES, dtype=net.conv3.dtype)
    for one, other, weight in zip(left, right, net.conv3, strict=True):
        _join_each(stored(one), stored(other), corners, stored(joined.view(-1)))
        products.baddbmm_(joined.transpose(0, 1), weight)
    maps = torch.empty(TILE, TILE * count, FEATURES)
    features(stored(products), net.conv3_bias.numpy(), (1, count), flat(maps))
    split = torch.empty(tiles, 64, FEATURES, dtype=net.hidden.dtype)
    _split_each(flat(maps), count, slots, stored(split.view(-1)))
    answers = torch.bmm(split.transpose(0, 1), net.hidden)
    made = torch.empty(TILE, TILE * tiles, UNITS)
    units(stored(answers), net.hidden_bias.numpy(), (1, tiles), flat(made))
    return made


@kernel
def _join_each(left: Stored, right: Stored, corners: NDArray[np.int64], tiles: Stored) -> None:
    """Join and transform the tile at each of some corners: as ``join`` of ``winograd.volume``."""
    size = 36 * JOINED
    for tile in range(corners.shape[0]):
        place = corners[tile, 0], corners[tile, 1], corners[tile, 2]
        join(left, right, place, (1, 1), tiles[tile * size : (tile + 1) * size])


@kernel
def _split_each(given: Flat, count: int, slots: NDArray[np.int64], tiles: Stored) -> None:
    """Put 8 x 8 tiles together from four of ``count`` tiles (4, 4 count, FEATURES), and transform them."""
    row = 8 * FEATURES
    part = np.empty(8 * 8 * FEATURES, np.float32)
    for tile in range(slots.shape[0]):
        for k in range(8):
            half = k // TILE * 2
            near = given[(k % TILE * count + slots[tile, half]) * TILE * FEATURES :]
            far = given[(k % TILE * count + slots[tile, half + 1]) * TILE * FEATURES :]
            line = part[k * row : (k + 1) * row]
            for c in range(FEATURES):
                store8(line, FEATURES, c, forward8(load4(near, FEATURES, c) + load4(far, FEATURES, c)))
        out = tiles[tile * 8 * row : (tile + 1) * 8 * row]
        for c in range(8 * FEATURES):
            store8(out, 8 * FEATURES, c, forward8(load8(part, 8 * FEATURES, c)))
