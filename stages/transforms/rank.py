"""The rank transform: it keeps the order of brightness and drops the brightness, and with it the lighting."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.transforms.gray import require_gray
from semidense.stages.transforms.window import require_window

LANES = 64
"""Rows of pixels are made up to a multiple of this, which is as many 8-bit numbers as a vector instruction takes."""
TOGETHER = 4
"""Window columns that are compared in one pass over a row."""
MOST = 252
"""Window columns whose pixels an 8-bit counter is sure to hold: a multiple of ``TOGETHER``."""


def rank(gray: NDArray[np.uint8], window: int = 31) -> NDArray[np.float32]:
    """Return the share of window pixels that are brighter than the centre.

    ``R(p) = |{q in N_p : I(q) > I(p)}| / |N_p|`` with ``N_p`` the ``window x window`` pixels around p, p among
    them, cut at the image border: ``|N_p|`` counts the pixels that are left.

    Each pixel of the window is compared with the centre: a row of centres at a time with the row of pixels that lie
    equally far from them, in 8-bit vector instructions. So the time grows with ``window ** 2``, but slowly: running
    histograms, whose time hardly grows, win only beyond about 50 px.

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
    radius = min(window // 2, max(gray.shape))
    out = np.empty(gray.shape, np.float32)
    beyond = -gray.shape[1] % LANES
    # Beyond the image lie zeros: none is brighter than a centre.
    padded = np.pad(gray, ((radius, radius), (radius, radius + beyond)))
    _rank(padded, np.pad(gray, ((0, 0), (0, beyond))), radius, out)
    return out


@kernel
def _rank(padded: NDArray[np.uint8], centres: NDArray[np.uint8], radius: int, out: NDArray[np.float32]) -> None:
    """Rank each pixel; both images are wider than ``out``, which the further columns of ``centres`` do not reach."""
    height, width = out.shape
    side = 2 * radius + 1
    part, total = np.empty(centres.shape[1], np.uint8), np.empty(centres.shape[1], np.uint32)
    for y in range(height):
        above, below = max(0, y - radius), min(height, y + radius + 1)
        total[:] = 0
        for row in range(above, below):
            for first in range(0, side, MOST):
                part[:] = 0
                _count(padded[row + radius, first:], centres[y], min(side - first, MOST), part)
                for x in range(len(part)):
                    total[x] += part[x]
        for x in range(width):
            across = min(width, x + radius + 1) - max(0, x - radius)
            out[y, x] = total[x] / ((below - above) * across)


@kernel
def _count(row: NDArray[np.uint8], centre: NDArray[np.uint8], columns: int, part: NDArray[np.uint8]) -> None:
    """Add to each centre's counter how many of the pixels from its place in the row on are brighter."""
    whole = columns - columns % TOGETHER
    for first in range(0, whole, TOGETHER):
        one, two, three, four = row[first:], row[first + 1 :], row[first + 2 :], row[first + 3 :]
        for x in range(len(part)):
            part[x] += (
                np.uint8(one[x] > centre[x])
                + np.uint8(two[x] > centre[x])
                + np.uint8(three[x] > centre[x])
                + np.uint8(four[x] > centre[x])
            )
    for first in range(whole, columns):
        last = row[first:]
        for x in range(len(part)):
            part[x] += np.uint8(last[x] > centre[x])
