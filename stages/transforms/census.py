"""The census transform: which neighbours are darker than the centre, a bit each, and the number of bits that differ."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import inlined, kernel
from semidense.stages.stage import StageError, require_shape

_MOST = 65
"""Pixels of the largest window: a bit for each of them but the centre."""


def census_transform(gray: NDArray[Any], window: tuple[int, int]) -> NDArray[np.uint64]:
    """Return a signature of each pixel: a bit for each neighbour in a window around it, set where it is darker.

    Args:
        gray: (y, x), any numbers; the signatures stay the same when these pass through a rising function.
        window: rows and columns, odd, at most 65 pixels in all.

    Returns:
        (y, x) uint64; neighbours beyond the image give 0.

    Raises:
        StageError: if ``gray`` is no (y, x), or the window is not of odd sides or too large.

    Source: Zabih & Woodfill, "Non-parametric local transforms for computing visual correspondence", ECCV 1994.
    """
    require_shape("gray", gray, 2)
    if not all(side % 2 for side in window) or window[0] * window[1] > _MOST:
        raise StageError(f"census window {window[0]} x {window[1]}: two odd sides, at most {_MOST} pixels in all")
    signatures = np.zeros(gray.shape, np.uint64)
    _sign(np.ascontiguousarray(gray), window[0] // 2, window[1] // 2, signatures)
    return signatures


@kernel
def _sign(gray: NDArray[Any], rows: int, columns: int, signatures: NDArray[np.uint64]) -> None:
    height, width = gray.shape
    for y in range(height):
        for x in range(width):
            signature = np.uint64(0)
            for v in range(y - rows, y + rows + 1):
                for u in range(x - columns, x + columns + 1):
                    if v == y and u == x:
                        continue
                    signature <<= np.uint64(1)
                    if 0 <= v < height and 0 <= u < width and gray[v, u] < gray[y, x]:
                        signature |= np.uint64(1)
            signatures[y, x] = signature


def hamming(left: NDArray[np.uint64], right: NDArray[np.uint64]) -> NDArray[np.float32]:
    """Return the number of bits in which two arrays of signatures differ: float32, 0 to 64.

    Raises:
        StageError: if they are no (y, x) of one shape.

    >>> hamming(np.array([[0b1011]], np.uint64), np.array([[0b0010]], np.uint64)).tolist()
    [[2.0]]
    """
    require_shape("signatures", left, 2)
    if left.shape != right.shape:
        raise StageError(f"signatures have shapes {left.shape} and {right.shape}: they must be equal")
    distance = np.empty(left.shape, np.float32)
    _count(left, right, distance)
    return distance


@inlined
def bits_set(value: np.uint64) -> np.uint64:
    """Return the number of bits that are set, adding neighbouring fields of 1, 2 and 4 bits, then all bytes."""
    value -= (value >> np.uint64(1)) & np.uint64(0x5555555555555555)
    value = (value & np.uint64(0x3333333333333333)) + ((value >> np.uint64(2)) & np.uint64(0x3333333333333333))
    value = (value + (value >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return (value * np.uint64(0x0101010101010101)) >> np.uint64(56)


@kernel
def _count(left: NDArray[np.uint64], right: NDArray[np.uint64], distance: NDArray[np.float32]) -> None:
    height, width = left.shape
    for y in range(height):
        for x in range(width):
            distance[y, x] = bits_set(left[y, x] ^ right[y, x])
