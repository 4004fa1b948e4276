"""The compact network's convolutions on joined maps, with 4.5 times fewer multiplications, exact in float32.

Winograd's minimal filtering computes a 4 x 4 tile of a convolution's output as ``A (G g G' * B d B') A'``:
input tile ``d`` and kernel ``g`` are transformed, multiplied number by number, and transformed back. Summed
over channels, the products are one matrix product for each number of a tile, which is where the time goes:

    layer    kernel   input tile   products an output, a channel   direct
    conv3    3 x 3    6 x 6        36 / 16 = 2.25                  9
    hidden   5 x 5    8 x 8        64 / 16 = 4                     25

The interpolation points are 0, +-1, +-2 and infinity, for the 5 x 5 kernel also +-1/2. They keep the rounding
errors of the whole at those of the direct sums (the tests hold both to the same bound).

The loops run over contiguous rows of channels, so that the compiler makes vector instructions of them;
the transforms are written out since their small numbers make most products additions.

Source: Lavin & Gray, Fast Algorithms for Convolutional Neural Networks, CVPR 2016; Winograd 1980.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from stages.kernel import inlined, kernel
from stages.matching.net import MatchingNet

TILE = 4
"""Rows and columns of outputs that one transformed tile answers."""
JOINED = 128
"""Filters of conv2, for each of the channels."""
FEATURES = 64
"""Filters of conv3."""
UNITS = 128
"""Units of the hidden layer."""
POINTS = {3: (0.0, 1.0, -1.0, 2.0, -2.0), 5: (0.0, 1.0, -1.0, 2.0, -2.0, 0.5, -0.5)}
"""Interpolation points of a kernel's side; infinity is the last of each."""

T = TypeVar("T", np.float32, NDArray[np.float64])

ZERO, HALF, QUARTER, EIGHTH = np.float32(0), np.float32(0.5), np.float32(0.25), np.float32(0.125)
TWO, FOUR, FIVE, EIGHT = np.float32(2), np.float32(4), np.float32(5), np.float32(8)
FIVE_HALVES, FIVE_QUARTERS = np.float32(2.5), np.float32(1.25)
QUARTERS_17, QUARTERS_21 = np.float32(4.25), np.float32(5.25)


@inlined
def forward6(a: T, b: T, c: T, d: T, e: T, f: T) -> tuple[T, ...]:
    """Return ``B d`` for six numbers."""
    return (
        FOUR * a - FIVE * c + e,
        d + e - FOUR * (b + c),
        FOUR * (b - c) - d + e,
        TWO * (d - b) - c + e,
        TWO * (b - d) - c + e,
        FOUR * b - FIVE * d + f,
    )


@inlined
def inverse6(a: T, b: T, c: T, d: T, e: T, f: T) -> tuple[T, ...]:
    """Return ``A m`` for six products: four outputs."""
    near, far = b - c, d - e
    return a + (b + c) + (d + e), near + TWO * far, (b + c) + FOUR * (d + e), near + EIGHT * far + f


@inlined
def forward8(a: T, b: T, c: T, d: T, e: T, f: T, g: T, h: T) -> tuple[T, ...]:
    """Return ``B d`` for eight numbers; the pairs of points +-p share their even and odd parts."""
    even1, odd1 = c + g - QUARTERS_17 * e, b + f - QUARTERS_17 * d
    even2, odd2 = g + QUARTER * c - FIVE_QUARTERS * e, HALF * b - FIVE_HALVES * d + TWO * f
    even3, odd3 = g + FOUR * c - FIVE * e, TWO * b - FIVE_HALVES * d + HALF * f
    return (
        a - g + QUARTERS_21 * (e - c),
        even1 + odd1,
        even1 - odd1,
        even2 + odd2,
        even2 - odd2,
        even3 + odd3,
        even3 - odd3,
        h - b + QUARTERS_21 * (d - f),
    )


@inlined
def inverse8(a: T, b: T, c: T, d: T, e: T, f: T, g: T, h: T) -> tuple[T, ...]:
    """Return ``A m`` for eight products: four outputs."""
    even1, odd1, even2, odd2, even3, odd3 = b + c, b - c, d + e, d - e, f + g, f - g
    return (
        a + even1 + even2 + even3,
        odd1 + TWO * odd2 + HALF * odd3,
        even1 + FOUR * even2 + QUARTER * even3,
        odd1 + EIGHT * odd2 + EIGHTH * odd3 + h,
    )


@kernel
def _join(
    left: NDArray[np.float32],
    right: NDArray[np.float32],
    corners: tuple[int, int, int],
    shape: tuple[int, int],
    tiles: NDArray[np.float32],
) -> None:
    """Add two views of one channel, cut at zero, and transform 6 x 6 tiles that lie 4 px apart.

    ``left`` and ``right``: y x JOINED. ``corners``: row, column in the left and in the right view. ``shape``:
    rows and columns of tiles. ``tiles``: (tile, 36, JOINED), flat.
    """
    y, x_left, x_right = corners
    row = 6 * JOINED
    part = np.empty(6 * 6 * JOINED, np.float32)  # one tile, transformed along its rows: fits the first-level cache
    ones, others = left.reshape(-1), right.reshape(-1)
    for tile in range(shape[0] * shape[1]):
        i, j = y + tile // shape[1] * TILE, tile % shape[1] * TILE
        for k in range(6):
            first = ((i + k) * left.shape[1] + x_left + j) * JOINED
            second = ((i + k) * right.shape[1] + x_right + j) * JOINED
            _join_row(ones[first : first + row], others[second : second + row], part[k * row : (k + 1) * row])
        _columns6(part, tiles[tile * 6 * row : (tile + 1) * 6 * row])


@inlined
def _join_row(one: NDArray[np.float32], other: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    """Add and cut six pixels, and transform along the row."""
    n = JOINED
    for c in range(JOINED):
        v = forward6(
            max(one[c] + other[c], ZERO),
            max(one[n + c] + other[n + c], ZERO),
            max(one[2 * n + c] + other[2 * n + c], ZERO),
            max(one[3 * n + c] + other[3 * n + c], ZERO),
            max(one[4 * n + c] + other[4 * n + c], ZERO),
            max(one[5 * n + c] + other[5 * n + c], ZERO),
        )
        out[c], out[n + c], out[2 * n + c], out[3 * n + c], out[4 * n + c], out[5 * n + c] = v


@inlined
def _columns6(part: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    """Transform along the columns: six rows in, six rows out."""
    n = 6 * JOINED
    for c in range(6 * JOINED):
        v = forward6(part[c], part[n + c], part[2 * n + c], part[3 * n + c], part[4 * n + c], part[5 * n + c])
        out[c], out[n + c], out[2 * n + c], out[3 * n + c], out[4 * n + c], out[5 * n + c] = v


@kernel
def _features(
    products: NDArray[np.float32], bias: NDArray[np.float32], shape: tuple[int, int], features: NDArray[np.float32]
) -> None:
    """Transform conv3's products back, add the bias, cut at zero.

    ``products``: (tile, 36, FEATURES), flat. ``features``: (4 rows, 4 columns, FEATURES), flat.
    """
    n, row = FEATURES, 6 * FEATURES
    part = np.empty(TILE * 6 * FEATURES, np.float32)
    for tile in range(shape[0] * shape[1]):
        m = products[tile * 6 * row : (tile + 1) * 6 * row]
        for c in range(6 * FEATURES):
            v = inverse6(m[c], m[row + c], m[2 * row + c], m[3 * row + c], m[4 * row + c], m[5 * row + c])
            part[c], part[row + c], part[2 * row + c], part[3 * row + c] = v
        for i in range(TILE):
            place = ((tile // shape[1] * TILE + i) * shape[1] + tile % shape[1]) * TILE * n
            p, out = part[i * row : (i + 1) * row], features[place : place + TILE * n]
            for c in range(FEATURES):
                v = inverse6(p[c], p[n + c], p[2 * n + c], p[3 * n + c], p[4 * n + c], p[5 * n + c])
                out[c] = max(v[0] + bias[c], ZERO)
                out[n + c] = max(v[1] + bias[c], ZERO)
                out[2 * n + c] = max(v[2] + bias[c], ZERO)
                out[3 * n + c] = max(v[3] + bias[c], ZERO)


@kernel
def _split(features: NDArray[np.float32], width: int, shape: tuple[int, int], tiles: NDArray[np.float32]) -> None:
    """Transform 8 x 8 tiles of the features that lie 4 px apart.

    ``features``: (y, width, FEATURES), flat. ``tiles``: (tile, 64, FEATURES), flat.
    """
    n, row = FEATURES, 8 * FEATURES
    part = np.empty(8 * 8 * FEATURES, np.float32)
    for tile in range(shape[0] * shape[1]):
        for k in range(8):
            place = ((tile // shape[1] * TILE + k) * width + tile % shape[1] * TILE) * n
            f, line = features[place : place + row], part[k * row : (k + 1) * row]
            for c in range(FEATURES):
                v = forward8(
                    f[c], f[n + c], f[2 * n + c], f[3 * n + c], f[4 * n + c], f[5 * n + c], f[6 * n + c], f[7 * n + c]
                )
                line[c], line[n + c], line[2 * n + c], line[3 * n + c] = v[0], v[1], v[2], v[3]
                line[4 * n + c], line[5 * n + c], line[6 * n + c], line[7 * n + c] = v[4], v[5], v[6], v[7]
        _columns8(part, tiles[tile * 8 * row : (tile + 1) * 8 * row])


@inlined
def _columns8(p: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    """Transform along the columns: eight rows in, eight rows out."""
    n = 8 * FEATURES
    for c in range(8 * FEATURES):
        v = forward8(p[c], p[n + c], p[2 * n + c], p[3 * n + c], p[4 * n + c], p[5 * n + c], p[6 * n + c], p[7 * n + c])
        out[c], out[n + c], out[2 * n + c], out[3 * n + c] = v[0], v[1], v[2], v[3]
        out[4 * n + c], out[5 * n + c], out[6 * n + c], out[7 * n + c] = v[4], v[5], v[6], v[7]


@kernel
def _units(
    products: NDArray[np.float32], bias: NDArray[np.float32], shape: tuple[int, int], units: NDArray[np.float32]
) -> None:
    """Transform the hidden layer's products back, add the bias, cut at zero.

    ``products``: (tile, 64, UNITS), flat. ``units``: (4 rows, 4 columns, UNITS), flat.
    """
    n, row = UNITS, 8 * UNITS
    part = np.empty(TILE * 8 * UNITS, np.float32)
    for tile in range(shape[0] * shape[1]):
        m = products[tile * 8 * row : (tile + 1) * 8 * row]
        for c in range(8 * UNITS):
            v = inverse8(
                m[c],
                m[row + c],
                m[2 * row + c],
                m[3 * row + c],
                m[4 * row + c],
                m[5 * row + c],
                m[6 * row + c],
                m[7 * row + c],
            )
            part[c], part[row + c], part[2 * row + c], part[3 * row + c] = v
        for i in range(TILE):
            place = ((tile // shape[1] * TILE + i) * shape[1] + tile % shape[1]) * TILE * n
            p, out = part[i * row : (i + 1) * row], units[place : place + TILE * n]
            for c in range(UNITS):
                v = inverse8(
                    p[c], p[n + c], p[2 * n + c], p[3 * n + c], p[4 * n + c], p[5 * n + c], p[6 * n + c], p[7 * n + c]
                )
                out[c] = max(v[0] + bias[c], ZERO)
                out[n + c] = max(v[1] + bias[c], ZERO)
                out[2 * n + c] = max(v[2] + bias[c], ZERO)
                out[3 * n + c] = max(v[3] + bias[c], ZERO)


def spread(weight: Tensor) -> Tensor:
    """Return a convolution's kernels in the transformed domain, computed in float64.

    With the interpolation points ``t``, row p of ``G`` is ``(1, t_p, t_p^2, ...) / B_p(t_p)``, where ``B_p`` is
    row p of ``B`` as a polynomial: so the scale of ``B``'s rows is free, and G follows from the transform itself.

    Args:
        weight: (out, in, side, side) with a side of 3 or 5.

    Returns:
        float32 (number of a tile, in, out).
    """
    side = weight.shape[2]
    forward = forward6 if side == 3 else forward8
    length = side + TILE - 1
    b = np.array(forward(*np.eye(length)), np.float64)  # row p: what each number of a tile adds to number p
    points = np.array(POINTS[side])
    scale = np.array([np.polyval(row[::-1], point) for row, point in zip(b, points, strict=False)])
    g = np.zeros((length, side))
    g[:-1] = points[:, None] ** np.arange(side) / scale[:, None]
    g[-1, -1] = 1 / b[-1, -1]
    made = np.einsum("pi,qj,oaij->pqao", g, g, weight.double().numpy())
    return torch.from_numpy(made.reshape(length * length, *made.shape[2:]).astype(np.float32))


@dataclass(frozen=True)
class TransformedNet:
    """What a joined block goes through, for a network with the compact head."""

    conv3: tuple[Tensor, ...]  # a channel: 36 JOINED FEATURES
    conv3_bias: NDArray[np.float32]
    hidden: Tensor  # 64 FEATURES UNITS
    hidden_bias: NDArray[np.float32]
    out: Tensor  # UNITS
    out_bias: float

    @classmethod
    def of(cls, net: MatchingNet) -> "TransformedNet":
        """Transform a network's kernels."""
        weights = {name: parameter.detach() for name, parameter in net.named_parameters()}
        parts = torch.split(weights["conv3.weight"], JOINED, 1)
        out, bias = (weights[f"out.{name}"][1] - weights[f"out.{name}"][0] for name in ("weight", "bias"))
        return cls(
            tuple(spread(part) for part in parts),
            weights["conv3.bias"].numpy(),
            spread(weights["hidden.0.weight"]),
            weights["hidden.0.bias"].numpy(),
            out.reshape(UNITS),
            float(bias),
        )

    def log_odds(
        self,
        left: NDArray[np.float32],
        right: NDArray[np.float32],
        corners: tuple[int, int, int],
        tiles: tuple[int, int],
    ) -> NDArray[np.float32]:
        """Return the log-odds of a mismatch of a block of cells at one disparity.

        Args:
            left: (channel, y, x, JOINED), the embedded left view.
            right: (channel, y, x, JOINED), the embedded right view.
            corners: the block's first row, first column in ``left`` and in ``right``. Of the views,
                6 more rows and columns than cells are read.
            tiles: rows and columns of the block, in tiles of 4 x 4 cells.

        Returns:
            float32 (4 rows, 4 columns).
        """
        wide = tiles[0] + 1, tiles[1] + 1  # the hidden layer reaches 4 px on
        count, inner = wide[0] * wide[1], tiles[0] * tiles[1]
        joined, summed = torch.empty(count, 36, JOINED), torch.zeros(count, 36, FEATURES)
        for one, other, weight in zip(left, right, self.conv3, strict=True):
            _join(one, other, corners, wide, joined.view(-1).numpy())
            summed.transpose(0, 1).baddbmm_(joined.transpose(0, 1), weight)
        features = np.empty(count * TILE * TILE * FEATURES, np.float32)
        _features(summed.view(-1).numpy(), self.conv3_bias, wide, features)
        split, products = torch.empty(inner, 64, FEATURES), torch.empty(inner, 64, UNITS)
        _split(features, wide[1] * TILE, tiles, split.view(-1).numpy())
        torch.bmm(split.transpose(0, 1), self.hidden, out=products.transpose(0, 1))
        units = torch.empty(inner * TILE * TILE, UNITS)
        _units(products.view(-1).numpy(), self.hidden_bias, tiles, units.view(-1).numpy())
        costs: NDArray[np.float32] = (units @ self.out + self.out_bias).reshape(tiles[0] * TILE, -1).numpy()
        return costs
