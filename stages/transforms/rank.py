"""The rank transform: it keeps the order of brightness and drops the brightness, and with it the lighting."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stages.kernel import kernel
from stages.transforms.gray import require_gray
from stages.transforms.window import require_window

LEVELS = 256


def rank(gray: NDArray[np.uint8], window: int = 31) -> NDArray[np.float32]:
    """Return the share of window pixels that are brighter than the centre.

    ``R(p) = |{q in N_p : I(q) > I(p)}| / |N_p|`` with ``N_p`` the ``window x window`` pixels around p, p among
    them, cut at the image border: ``|N_p|`` counts the pixels that are left.

    A histogram of each column of the window runs down the image, and their sum runs along each row (Perreault &
    Hebert, IEEE TIP 2007), so that a pixel costs the same whatever the window.

    Args:
        gray: (y, x) uint8.
        window: side of the window, px, odd, at least 3; it may exceed the image.

    Returns:
        (y, x) float32, a pure number in [0, 1): the float32 nearest to the exact quotient.

    Raises:
        StageError: if ``gray`` is not an 8-bit gray image or ``window`` is even or below 3.

    Source: Zabih & Woodfill, ECCV 1994, as a share of the window.

    >>> rank(np.array([[1, 2, 3]], np.uint8), window=3).tolist()
    [[0.5, 0.3333333432674408, 0.0]]
    """
    require_gray(gray)
    require_window(window)
    counter = np.uint16 if window <= 255 else np.uint32  # holds window ** 2; the narrower, the faster
    columns = np.zeros((gray.shape[1], LEVELS), counter)
    out = np.empty(gray.shape, np.float32)
    _rank(gray, window // 2, columns, out)
    return out


@kernel
def _rank(gray: NDArray[np.uint8], radius: int, columns: NDArray[Any], out: NDArray[np.float32]) -> None:
    height, width = gray.shape
    nothing, total = np.zeros_like(columns[0]), np.zeros_like(columns[0])
    for y in range(-radius, height):
        if y + radius < height:
            _count(columns, gray[y + radius], 1)
        if y > radius:
            _count(columns, gray[y - radius - 1], -1)
        if y < 0:
            continue
        total[:] = 0
        down = min(height, y + radius + 1) - max(0, y - radius)
        for x in range(-radius, width):
            enters = columns[x + radius] if x + radius < width else nothing
            leaves = columns[x - radius - 1] if x > radius else nothing
            _slide(total, enters, leaves)
            if x >= 0:
                across = min(width, x + radius + 1) - max(0, x - radius)
                out[y, x] = _above(total, gray[y, x]) / (down * across)


@kernel
def _count(columns: NDArray[Any], row: NDArray[np.uint8], sign: int) -> None:
    """Let a row of the image enter (1) or leave (-1) the histograms of the columns."""
    for x in range(row.size):
        columns[x, row[x]] += sign


@kernel
def _slide(total: NDArray[Any], enters: NDArray[Any], leaves: NDArray[Any]) -> None:
    """Move the window's histogram one column on."""
    for level in range(LEVELS):
        total[level] += enters[level] - leaves[level]


@kernel
def _above(total: NDArray[Any], level: int) -> int:
    """Return how many pixels of the window are brighter than a level."""
    brighter = np.int32(0)
    for other in range(level + 1, LEVELS):
        brighter += np.int32(total[other])
    return int(brighter)
