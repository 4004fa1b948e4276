"""Name the kinds of array that scenes are made of, and refuse what is not of the kind."""

from os import PathLike, fspath
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from semidense.datasets.errors import DatasetError

ImageArray: TypeAlias = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]
"""An image: (y, x) gray or (y, x, 3) RGB, 8 or 16 bits a channel."""

DisparityMap: TypeAlias = npt.NDArray[np.float32]
"""Disparities in pixels, (y, x), NaN where unknown."""

Mask: TypeAlias = npt.NDArray[np.bool_]
"""Pixels that belong, (y, x)."""


def size_text(array: np.ndarray[Any, Any]) -> str:
    """Return rows and columns as a message says them."""
    return " x ".join(map(str, array.shape[:2]))


def array_text(array: np.ndarray[Any, Any]) -> str:
    """Return type and shape as a message says them."""
    return f"{array.dtype}, {' x '.join(map(str, array.shape)) or 'a scalar'}"


def as_array(what: str, given: object) -> np.ndarray[Any, Any]:
    """Return what a user gave as an array; a masked one keeps its mask.

    Raises:
        DatasetError: If it is None, a path, or nothing that NumPy takes.
    """
    if given is None:
        raise DatasetError(f"{what} is None: was its file read?")
    if isinstance(given, str | PathLike):
        raise DatasetError(f"{what} is the path {fspath(given)!r}, no array: give all as arrays, or all as files")
    try:
        return given if isinstance(given, np.ma.MaskedArray) else np.asarray(given)
    except (ValueError, TypeError, RuntimeError) as error:  # torch raises the latter two
        raise DatasetError(f"{what} is no array: {error}; give a NumPy array") from error


def check_image(what: str, image: ImageArray) -> None:
    """Refuse what is not an image: DatasetError."""
    gray_or_rgb = image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)
    if image.dtype not in (np.uint8, np.uint16) or not gray_or_rgb:
        raise DatasetError(
            f"{what} is {array_text(image)}; give uint8 or uint16, (rows, columns) or (rows, columns, 3)"
        )
    if image.size == 0:
        raise DatasetError(f"{what} is empty ({size_text(image)} pixels)")


def check_map(what: str, disparity: DisparityMap) -> None:
    """Refuse what is not a disparity map: DatasetError."""
    if disparity.dtype != np.float32 or disparity.ndim != 2 or disparity.size == 0:
        raise DatasetError(f"{what} is {array_text(disparity)}; give float32, (rows, columns), not empty")
    if np.isinf(disparity).any():
        raise DatasetError(f"{what} holds infinite disparities; mark unknown pixels with NaN")
