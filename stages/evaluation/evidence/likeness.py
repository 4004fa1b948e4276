"""What the left view tells of its neighbourhood: whether a patch is one of its kind, and which neighbours agree."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.evaluation.agreement import TOLERANCE
from semidense.stages.evaluation.declaration import RADIUS

NEAREST, FARTHEST = 2, 40
"""Shifts along the row by which a patch is compared with others, px."""
_PATCH = 3
_REACH = _PATCH + FARTHEST
"""What is asked of a pixel lies within so many px."""
SUPPORT_RADIUS, SUPPORT_STEP = 12, 2
"""Every second neighbour up to so many px away is asked."""
CONTRAST = 10.0
"""Difference of gray values at which a neighbour's weight falls to 1/e."""


def distinctiveness(gray: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return how unlike its row a patch of 7 x 7 px is: 0 in a blank or repeated pattern, where no matcher can tell.

    Args:
        gray: (y, x) uint8.

    Returns:
        (y, x) float32 in [0, 255], gray levels: the least mean difference to the patches 2 to 40 px away in its row;
        NaN in the outer 43 px, where they do not all lie within the array.

    Source: Manduchi & Tomasi, "Distinctiveness maps for image matching", ICIAP 1999.
    """
    least = np.full(gray.shape, np.nan, np.float32)
    _write_least(gray.astype(np.int64), least)
    return least


@kernel
def _write_least(gray: NDArray[np.int64], least: NDArray[np.float32]) -> None:
    height, width = gray.shape
    columns = np.empty(width, np.int64)
    for y in range(_REACH, height - _REACH):
        best = np.full(width, 255 * 49, np.int64)
        for shift in range(NEAREST, FARTHEST + 1):
            columns[:] = 0
            for row in range(y - _PATCH, y + _PATCH + 1):
                for x in range(width - shift):
                    columns[x] += abs(gray[row, x] - gray[row, x + shift])
            total = columns[: 2 * _PATCH].sum()
            for x in range(_PATCH, width - shift - _PATCH):
                total += columns[x + _PATCH]
                best[x] = min(best[x], total)
                best[x + shift] = min(best[x + shift], total)
                total -= columns[x - _PATCH]
        for x in range(_REACH, width - _REACH):
            least[y, x] = best[x] / (2 * _PATCH + 1) ** 2


def support(disparity: NDArray[np.float32], gray: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the share of a pixel's likely surface that agrees with its disparity: neighbours count by their colour.

    Args:
        disparity: (y + 100, x + 100) float32, px; NaN: none.
        gray: (y + 100, x + 100) uint8.

    Returns:
        (y, x) float32 in [0, 1]: of every second neighbour up to 12 px away, weighed by ``exp(-|difference| / 10)`` of
        the gray values, the share within 1 px of the pixel's disparity. A neighbour without disparity does not agree.
    """
    found = np.empty([length - 2 * RADIUS for length in disparity.shape], np.float32)
    weights = np.exp(-np.arange(256) / CONTRAST).astype(np.float32)
    _write_support(np.ascontiguousarray(disparity), gray.astype(np.int32), weights, np.float32(TOLERANCE), found)
    return found


@kernel
def _write_support(
    disparity: NDArray[np.float32],
    gray: NDArray[np.int32],
    weights: NDArray[np.float32],
    tolerance: np.float32,
    found: NDArray[np.float32],
) -> None:
    """Add one neighbour of all pixels of a row, then the next: so many are weighed at once."""
    height, width = found.shape
    agreeing, total, weight = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
    for y in range(RADIUS, RADIUS + height):
        agreeing[:] = 0
        total[:] = 0
        own, own_gray = disparity[y, RADIUS:], gray[y, RADIUS:]
        for row in range(y - SUPPORT_RADIUS, y + SUPPORT_RADIUS + 1, SUPPORT_STEP):
            for first in range(RADIUS - SUPPORT_RADIUS, RADIUS + SUPPORT_RADIUS + 1, SUPPORT_STEP):
                if row == y and first == RADIUS:
                    continue  # the pixel itself: beside it the weights of unlike neighbours would be lost
                other, other_gray = disparity[row, first:], gray[row, first:]
                for x in range(width):  # an index that is never negative, and few arrays a loop, take vectors
                    weight[x] = weights[np.uint32(abs(other_gray[x] - own_gray[x]))]
                for x in range(width):
                    total[x] += weight[x]
                    agreeing[x] += weight[x] if abs(other[x] - own[x]) <= tolerance else np.float32(0)
        for x in range(width):
            found[y - RADIUS, x] = agreeing[x] / total[x]
