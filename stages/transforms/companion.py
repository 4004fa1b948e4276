"""The companion transform: how much of what a pixel sees along its rays is exactly as bright as itself."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.transforms.gray import require_gray
from semidense.stages.transforms.rays import LINES, require_rays
from semidense.stages.transforms.window import require_window


def companion(gray: NDArray[np.uint8], window: int = 61, rays: int = 8) -> NDArray[np.float32]:
    """Return the share of the pixels on a pixel's rays that have exactly its intensity.

    ``C(p) = |{q in N_p & O_p : I(q) = I(p)}| / |N_p & O_p|`` with ``N_p`` the ``window x window`` pixels around p
    and ``O_p`` the pixels on the rays from p, p itself not among them. Both numbers count only pixels inside the
    image.

    A ray is the pixels ``p + k s``, k = 1, 2, ..., for a step ``s = (dy, dx)``. 4 rays: (0, ±1) and (±1, 0); 8 rays:
    also the diagonals (±1, ±1); 16 rays: also the knight's moves (±1, ±2) and (±2, ±1), of which ``radius // 2``
    pixels fit on a ray where the others have ``radius = window // 2``. No pixel lies on two rays.

    A histogram runs along each line, so that a pixel costs O(rays), whatever the window.

    Args:
        gray: (y, x) uint8.
        window: side of the window, px, odd, at least 3; it may exceed the image.
        rays: 4, 8 or 16.

    Returns:
        (y, x) float32, a pure number in [0, 1]: the float32 nearest to the exact quotient. A pixel that has no
        ray pixel (an image of 1 x 1) is 0.

    Raises:
        StageError: if ``gray`` is not an 8-bit gray image, ``window`` is even or below 3, or ``rays`` is neither.

    >>> companion(np.array([[7, 7, 1, 7]], np.uint8), window=5, rays=4).tolist()
    [[0.5, 0.6666666865348816, 0.0, 0.5]]
    """
    require_gray(gray)
    radius = require_window(window) // 2
    same = np.zeros(gray.shape, np.int32)
    seen = np.zeros(gray.shape, np.int32)
    for dy, dx in LINES[require_rays(rays)]:
        _count(np.ascontiguousarray(gray), dy, dx, radius // max(abs(dy), abs(dx)), same, seen)
    return (same / np.maximum(seen, 1)).astype(np.float32)


@kernel
def _count(
    gray: NDArray[np.uint8], dy: int, dx: int, reach: int, same: NDArray[np.int32], seen: NDArray[np.int32]
) -> None:
    """Add what each pixel sees along both directions of a step. A line starts where one step back leaves the image."""
    height, width = gray.shape
    histogram = np.empty(256, np.int32)
    for y in range(height):
        for x in range(width):
            if y < dy or not 0 <= x - dx < width:
                histogram[:] = 0
                _walk(gray, y, x, dy, dx, reach, histogram, same, seen)


@kernel
def _walk(
    gray: NDArray[np.uint8],
    y: int,
    x: int,
    dy: int,
    dx: int,
    reach: int,
    histogram: NDArray[np.int32],
    same: NDArray[np.int32],
    seen: NDArray[np.int32],
) -> None:
    """Follow one line with a histogram of the pixels within reach of the one at hand, on both sides."""
    length = _length(gray.shape, y, x, dy, dx)
    for i in range(min(reach, length)):
        histogram[gray[y + i * dy, x + i * dx]] += 1
    for i in range(length):
        ahead, behind = i + reach, i - reach - 1
        if ahead < length:
            histogram[gray[y + ahead * dy, x + ahead * dx]] += 1
        if behind >= 0:
            histogram[gray[y + behind * dy, x + behind * dx]] -= 1
        here = y + i * dy, x + i * dx
        same[here] += histogram[gray[here]] - 1  # the pixel itself is in the histogram
        seen[here] += min(ahead, length - 1) - max(behind + 1, 0)


@kernel
def _length(shape: tuple[int, int], y: int, x: int, dy: int, dx: int) -> int:
    """Return the number of steps from a pixel, itself included, that stay inside the image."""
    height, width = shape
    length = height + width
    if dy > 0:
        length = min(length, (height - 1 - y) // dy + 1)
    if dx > 0:
        length = min(length, (width - 1 - x) // dx + 1)
    if dx < 0:
        length = min(length, x // -dx + 1)
    return length
