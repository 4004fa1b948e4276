"""Winograd's minimal filtering: a tile of a convolution's output with fewer multiplications.

``y = A' (G g * B d)`` gives 4 outputs of a filter ``g`` of 3 or 5 taps from 6 or 8 inputs ``d`` by 6 or 8
products instead of 12 or 20; in two dimensions both sides save, and the transforms are shared by all channels:

    kernel   input tile   products an output   direct
    3 x 3    6 x 6        36 / 16 = 2.25       9
    5 x 5    8 x 8        64 / 16 = 4          25

Every transform is linear, so its transpose carries gradients back. The interpolation points are 0, +-1, +-2
and infinity, for five taps also +-1/2: of the usual choices those that round least in float32.

The transforms are written out, since their small numbers make most products additions. ``load`` and ``store``
reach for the numbers of a tile in a flat array in which a number's channels lie side by side: a loop over the
channels then becomes vector instructions. ``gather`` and ``pick`` do so where a number's tiles lie side by side.

Source: Lavin & Gray, Fast Algorithms for Convolutional Neural Networks, CVPR 2016, after S. Winograd, 1980.
"""

from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semidense.stages.compute.kernel import inlined
from semidense.stages.matching.winograd.storage import Flat, Stored, rounded, widened

TILE = 4
"""Rows and columns of outputs that one transformed tile answers."""
POINTS = {3: (0.0, 1.0, -1.0, 2.0, -2.0), 5: (0.0, 1.0, -1.0, 2.0, -2.0, 0.5, -0.5)}
"""Interpolation points for each number of taps; infinity is the last of each."""

T = TypeVar("T", np.float32, NDArray[np.float64], NDArray[np.float32])
Part = TypeVar("Part")
Four = tuple[Part, Part, Part, Part]
Six = tuple[Part, Part, Part, Part, Part, Part]
Eight = tuple[Part, Part, Part, Part, Part, Part, Part, Part]

HALF, QUARTER, EIGHTH = np.float32(0.5), np.float32(0.25), np.float32(0.125)
TWO, FOUR, FIVE, EIGHT = np.float32(2), np.float32(4), np.float32(5), np.float32(8)
FIVE_HALVES, FIVE_QUARTERS = np.float32(2.5), np.float32(1.25)
QUARTERS_17, QUARTERS_21 = np.float32(4.25), np.float32(5.25)


@inlined
def load4(p: Flat, n: int, c: int) -> Four[np.float32]:
    """Return channel ``c`` of four numbers of ``n`` channels."""
    return p[c], p[n + c], p[2 * n + c], p[3 * n + c]


@inlined
def load6(p: Stored, n: int, c: int) -> Six[np.float32]:
    """Return channel ``c`` of six numbers of ``n`` channels."""
    return (
        widened(p[c]),
        widened(p[n + c]),
        widened(p[2 * n + c]),
        widened(p[3 * n + c]),
        widened(p[4 * n + c]),
        widened(p[5 * n + c]),
    )


@inlined
def load8(p: Flat, n: int, c: int) -> Eight[np.float32]:
    """Return channel ``c`` of eight numbers of ``n`` channels."""
    return p[c], p[n + c], p[2 * n + c], p[3 * n + c], p[4 * n + c], p[5 * n + c], p[6 * n + c], p[7 * n + c]


@inlined
def gather6(p: Stored, first: int, tile: int) -> Six[Stored]:
    """Return the channels of six numbers of a tile, a row of six apart: of (number, tile, channel)."""
    return (
        p[first, tile],
        p[6 + first, tile],
        p[12 + first, tile],
        p[18 + first, tile],
        p[24 + first, tile],
        p[30 + first, tile],
    )


@inlined
def gather8(p: Stored, first: int, tile: int) -> Eight[Stored]:
    """Return the channels of eight numbers of a tile, a row of eight apart: of (number, tile, channel)."""
    return (
        p[first, tile],
        p[8 + first, tile],
        p[16 + first, tile],
        p[24 + first, tile],
        p[32 + first, tile],
        p[40 + first, tile],
        p[48 + first, tile],
        p[56 + first, tile],
    )


@inlined
def pick6(p: Six[Stored], c: int) -> Six[np.float32]:
    """Return channel ``c`` of six numbers."""
    return (
        widened(p[0][c]),
        widened(p[1][c]),
        widened(p[2][c]),
        widened(p[3][c]),
        widened(p[4][c]),
        widened(p[5][c]),
    )


@inlined
def pick8(p: Eight[Stored], c: int) -> Eight[np.float32]:
    """Return channel ``c`` of eight numbers."""
    return (
        widened(p[0][c]),
        widened(p[1][c]),
        widened(p[2][c]),
        widened(p[3][c]),
        widened(p[4][c]),
        widened(p[5][c]),
        widened(p[6][c]),
        widened(p[7][c]),
    )


@inlined
def store4(p: Flat, n: int, c: int, v: Four[np.float32]) -> None:
    """Write channel ``c`` of four numbers of ``n`` channels."""
    p[c], p[n + c], p[2 * n + c], p[3 * n + c] = v


@inlined
def store6(p: Stored, n: int, c: int, v: Six[np.float32]) -> None:
    """Write channel ``c`` of six numbers of ``n`` channels."""
    p[c], p[n + c], p[2 * n + c] = rounded(v[0], p), rounded(v[1], p), rounded(v[2], p)
    p[3 * n + c], p[4 * n + c], p[5 * n + c] = rounded(v[3], p), rounded(v[4], p), rounded(v[5], p)


@inlined
def place6(p: Six[Stored], c: int, v: Six[np.float32]) -> None:
    """Write channel ``c`` of six numbers that ``gather6`` found."""
    p[0][c], p[1][c], p[2][c] = rounded(v[0], p[0]), rounded(v[1], p[1]), rounded(v[2], p[2])
    p[3][c], p[4][c], p[5][c] = rounded(v[3], p[3]), rounded(v[4], p[4]), rounded(v[5], p[5])


@inlined
def store8(p: Stored, n: int, c: int, v: Eight[np.float32]) -> None:
    """Write channel ``c`` of eight numbers of ``n`` channels."""
    p[c], p[n + c], p[2 * n + c] = rounded(v[0], p), rounded(v[1], p), rounded(v[2], p)
    p[3 * n + c], p[4 * n + c], p[5 * n + c] = rounded(v[3], p), rounded(v[4], p), rounded(v[5], p)
    p[6 * n + c], p[7 * n + c] = rounded(v[6], p), rounded(v[7], p)


@inlined
def forward6(numbers: Six[T]) -> Six[T]:
    """Return ``B d`` of three taps."""
    a, b, c, d, e, f = numbers
    return (
        FOUR * a - FIVE * c + e,
        d + e - FOUR * (b + c),
        FOUR * (b - c) - d + e,
        TWO * (d - b) - c + e,
        TWO * (b - d) - c + e,
        FOUR * b - FIVE * d + f,
    )


@inlined
def forward6_transposed(gradients: Six[T]) -> Six[T]:
    """Return the gradients of ``forward6``'s arguments from those of its results."""
    a, b, c, d, e, f = gradients
    return (
        FOUR * a,
        FOUR * (c - b + f) + TWO * (e - d),
        -FIVE * a - FOUR * (b + c) - d - e,
        b - c + TWO * (d - e) - FIVE * f,
        a + b + c + d + e,
        f,
    )


@inlined
def inverse6(products: Six[T]) -> Four[T]:
    """Return ``A' m`` of three taps: four outputs."""
    a, b, c, d, e, f = products
    near, far = b - c, d - e
    return a + (b + c) + (d + e), near + TWO * far, (b + c) + FOUR * (d + e), near + EIGHT * far + f


@inlined
def inverse6_transposed(gradients: Four[T]) -> Six[T]:
    """Return the gradients of ``inverse6``'s arguments from those of its results."""
    a, b, c, d = gradients
    even1, odd1 = a + c, b + d
    even2, odd2 = a + FOUR * c, TWO * b + EIGHT * d
    return a, even1 + odd1, even1 - odd1, even2 + odd2, even2 - odd2, d


@inlined
def forward8(numbers: Eight[T]) -> Eight[T]:
    """Return ``B d`` of five taps; the pairs of points +-p share their even and odd parts."""
    a, b, c, d, e, f, g, h = numbers
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
def forward8_transposed(gradients: Eight[T]) -> Eight[T]:
    """Return the gradients of ``forward8``'s arguments from those of its results."""
    a, b, c, d, e, f, g, h = gradients
    even1, odd1, even2, odd2, even3, odd3 = b + c, b - c, d + e, d - e, f + g, f - g
    return (
        a,
        odd1 + HALF * odd2 + TWO * odd3 - h,
        even1 + QUARTER * even2 + FOUR * even3 - QUARTERS_21 * a,
        QUARTERS_21 * h - QUARTERS_17 * odd1 - FIVE_HALVES * (odd2 + odd3),
        QUARTERS_21 * a - QUARTERS_17 * even1 - FIVE_QUARTERS * even2 - FIVE * even3,
        odd1 + TWO * odd2 + HALF * odd3 - QUARTERS_21 * h,
        even1 + even2 + even3 - a,
        h,
    )


@inlined
def inverse8(products: Eight[T]) -> Four[T]:
    """Return ``A' m`` of five taps: four outputs."""
    a, b, c, d, e, f, g, h = products
    even1, odd1, even2, odd2, even3, odd3 = b + c, b - c, d + e, d - e, f + g, f - g
    return (
        a + even1 + even2 + even3,
        odd1 + TWO * odd2 + HALF * odd3,
        even1 + FOUR * even2 + QUARTER * even3,
        odd1 + EIGHT * odd2 + EIGHTH * odd3 + h,
    )


@inlined
def inverse8_transposed(gradients: Four[T]) -> Eight[T]:
    """Return the gradients of ``inverse8``'s arguments from those of its results."""
    a, b, c, d = gradients
    even1, odd1 = a + c, b + d
    even2, odd2 = a + FOUR * c, TWO * b + EIGHT * d
    even3, odd3 = a + QUARTER * c, HALF * b + EIGHTH * d
    return a, even1 + odd1, even1 - odd1, even2 + odd2, even2 - odd2, even3 + odd3, even3 - odd3, d


def spread(weight: Tensor) -> Tensor:
    """Return a convolution's kernels in the transformed domain, ``G g G'``; gradients flow through it.

    Row p of ``G`` is ``(1, t_p, t_p^2, ...) / B_p(t_p)`` with the interpolation points ``t`` and row p of ``B``
    as a polynomial: so the scale of ``B``'s rows is free, and G follows from the transform itself.

    Args:
        weight: (out, in, taps, taps) with 3 or 5 taps.

    Returns:
        (number of a tile, in, out), of the weight's dtype.
    """
    taps = weight.shape[2]
    length = taps + TILE - 1
    unit = np.eye(length)
    b = np.array(forward6(tuple(unit)) if taps == 3 else forward8(tuple(unit)))  # type: ignore[arg-type]
    points = np.array(POINTS[taps])
    scale = np.array([np.polyval(row[::-1], point) for row, point in zip(b, points, strict=False)])
    g = np.zeros((length, taps))
    g[:-1] = points[:, None] ** np.arange(taps) / scale[:, None]
    g[-1, -1] = 1 / b[-1, -1]
    square = torch.from_numpy(np.kron(g, g)).to(weight.dtype)  # number of a tile, tap
    return torch.einsum("nt,oit->nio", square, weight.flatten(2))
