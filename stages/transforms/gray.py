"""Gray values of an image: BT.601 luma in 8 bits, by exact integer arithmetic."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.stage import Images, StageError

LUMA = (299, 587, 114)
"""ITU-R BT.601 weights of red, green and blue, in thousandths."""


def to_gray(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the gray values of an image in 8 bits.

    8-bit colour: ``floor((299 R + 587 G + 114 B + 500) / 1000)``, the luma rounded half up. 16-bit images are
    brought to 8 bits by the factor 1/257 (65535 -> 255) in the same single rounding:
    ``floor((299 R + 587 G + 114 B + 128500) / 257000)`` and ``floor((v + 128) / 257)`` for one band. So an
    8-bit image stored as ``257 v`` in 16 bits gives exactly the gray of the 8-bit image.

    Args:
        image: (y, x), (y, x, 1) or (y, x, 3) in the order red, green, blue; uint8 or uint16.

    Returns:
        (y, x) uint8 in [0, 255]; an 8-bit image of one band comes back with its own values.

    Raises:
        StageError: for another dtype or shape, or an image without pixels.

    Source: Recommendation ITU-R BT.601, section 2.5.1.

    >>> to_gray(np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255]]], np.uint8)).tolist()
    [[76, 150, 29]]
    >>> to_gray(np.array([[0, 128, 129, 65535]], np.uint16)).tolist()
    [[0, 0, 1, 255]]
    """
    _require_image(image)
    scale = 257 if image.dtype == np.uint16 else 1
    if image.ndim == 3 and image.shape[2] == 3:
        total, unit = _weighted(image), 1000 * scale
    else:
        total, unit = image.reshape(image.shape[:2]).astype(np.uint32), scale
    return ((total + unit // 2) // unit).astype(np.uint8)


def gray_moments(gray: NDArray[np.uint8]) -> tuple[float, float]:
    """Return the mean and the standard deviation (population) of an image's gray values.

    Both come from exact integer sums, so they depend on neither the order of the pixels nor the machine.

    Args:
        gray: (y, x) uint8.

    Returns:
        The mean in [0, 255] and the standard deviation in [0, 127.5].

    Raises:
        StageError: if ``gray`` is not an 8-bit image with at least one pixel.

    >>> gray_moments(np.array([[0, 0], [10, 10]], np.uint8))
    (5.0, 5.0)
    """
    require_gray(gray)
    share = np.bincount(gray.ravel(), minlength=256).tolist()
    count = gray.size
    total = sum(value * number for value, number in enumerate(share))
    squares = sum(value * value * number for value, number in enumerate(share))
    return total / count, ((count * squares - total * total) / (count * count)) ** 0.5


def require_gray(gray: NDArray[Any]) -> None:
    """Refuse what is not an 8-bit gray image.

    Raises:
        StageError: unless ``gray`` is (y, x) uint8 with at least one pixel.
    """
    if gray.ndim != 2 or gray.dtype != np.uint8 or gray.size == 0:
        raise StageError(f"gray is {gray.dtype} {gray.shape}, expected (y, x) uint8 with pixels: apply to_gray first")


def _weighted(image: NDArray[Any]) -> NDArray[np.uint32]:
    """Return 1000 times the luma; at most 65535000, so 32 bits hold it."""
    red, green, blue = (image[..., band].astype(np.uint32) * np.uint32(weight) for band, weight in enumerate(LUMA))
    total: NDArray[np.uint32] = red + green + blue
    return total


def _require_image(image: NDArray[Any]) -> None:
    if image.dtype not in (np.uint8, np.uint16):
        raise StageError(f"image has dtype {image.dtype}, expected uint8 or uint16: convert it, with its range, first")
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] not in (1, 3)):
        raise StageError(f"image has shape {image.shape}, expected (y, x), (y, x, 1) or (y, x, 3)")
    if image.size == 0:
        raise StageError(f"image has shape {image.shape}: there is no pixel")


def gray_views(images: Images) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return both views of the product ``images`` as 8-bit gray (y, x)."""
    return to_gray(images["left"]), to_gray(images["right"])
