"""The census matcher: which neighbours are darker than the centre, compared bit by bit."""

import numpy as np
from numpy.typing import NDArray

from stages.baselines.declaration import CENSUS_WINDOW, WindowParams
from stages.baselines.window import match_windows
from stages.kernel import inlined, kernel
from stages.stage import Arrays, Inputs
from stages.transforms.gray import to_gray


def census_transform(gray: NDArray[np.uint8]) -> NDArray[np.uint64]:
    """Return a signature of each pixel: a bit for each neighbour in a window of 7 x 9, set where it is darker.

    Args:
        gray: (y, x) uint8.

    Returns:
        (y, x) uint64; neighbours beyond the image give 0.

    Source: Zabih & Woodfill, "Non-parametric local transforms for computing visual correspondence", ECCV 1994.
    """
    signatures = np.zeros(gray.shape, np.uint64)
    _sign(np.ascontiguousarray(gray), CENSUS_WINDOW[0] // 2, CENSUS_WINDOW[1] // 2, signatures)
    return signatures


@kernel
def _sign(gray: NDArray[np.uint8], rows: int, columns: int, signatures: NDArray[np.uint64]) -> None:
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

    >>> hamming(np.array([[0b1011]], np.uint64), np.array([[0b0010]], np.uint64)).tolist()
    [[2.0]]
    """
    distance = np.empty(left.shape, np.float32)
    _count(left, right, distance)
    return distance


@inlined
def _bits(value: np.uint64) -> np.uint64:
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
            distance[y, x] = _bits(left[y, x] ^ right[y, x])


def compute_census(params: WindowParams, inputs: Inputs) -> Arrays:
    """Compute the product ``census``; see ``match_windows`` and ``census_transform``."""
    left, right = (census_transform(to_gray(inputs["images"][view])) for view in ("left", "right"))

    def costs(_: int, columns: slice, seen: slice) -> NDArray[np.float32]:
        return hamming(left[:, columns], right[:, seen])

    return match_windows(costs, left.shape, params.disparities, params.window, params.tolerance)
