"""Read and write disparity maps as KITTI's 16-bit PNG: the stored value is 256 times the disparity, 0 means none.

Source: the development kit of Menze & Geiger, "Object Scene Flow for Autonomous Vehicles", CVPR 2015.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from semidense.datasets.arrays import DisparityMap
from semidense.datasets.errors import Png16Error
from semidense.datasets.formats.atomic import atomic_write
from semidense.datasets.formats.images import read_image
from semidense.datasets.formats.limits import check_pixels

if TYPE_CHECKING:
    from PIL.PngImagePlugin import PngInfo

SCALE = 256
"""Steps to a pixel of disparity."""
PNG_LEVEL = 2
"""How hard zlib works on a PNG file. Pillow's own level, 6, takes three times as long for files 6 % smaller."""

_LARGEST = np.iinfo(np.uint16).max


def read_png16(path: str | os.PathLike[str]) -> DisparityMap:
    """Read a KITTI disparity map.

    Returns:
        (y, x) float32, pixels, exact multiples of 1/256; NaN where the file has 0.

    Raises:
        MissingFileError: If there is no such file.
        ImageError: If the file is no readable image.
        Png16Error: If the image is not 16-bit gray.
    """
    stored = read_image(path)
    if stored.dtype != np.uint16:
        raise Png16Error(f"{path}: an 8-bit image; KITTI stores disparities as 16-bit gray PNG")
    return np.where(stored > 0, stored.astype(np.float32) / SCALE, np.float32(np.nan)).astype(np.float32)


def write_png16(
    path: str | os.PathLike[str],
    disparity: np.ndarray[tuple[int, ...], np.dtype[np.floating]],
    scale: float = SCALE,
    about: Mapping[str, str] | None = None,
) -> None:
    """Write a map as 16-bit gray PNG, atomically; with the usual scale, KITTI's disparity format.

    Values are rounded to the nearest step, so that reading back is exact within half a step. A known value below half a
    step is stored as one step, because 0 means none.

    Args:
        path: Where to; an existing file is replaced.
        disparity: (y, x) float, from 0 to 65535 steps, NaN where unknown.
        scale: Steps to a unit.
        about: Names and texts to store in the file.

    Raises:
        Png16Error: If the array is not a float map of (y, x), is empty, or holds values outside that range.
        OSError: If the file cannot be written.
    """
    from PIL import Image  # here, as few who import this write

    path, disparity = Path(path), np.asarray(disparity)
    if disparity.ndim != 2 or disparity.dtype.kind != "f":
        raise Png16Error(f"{path}: give a float array of (rows, columns), not {disparity.dtype} of {disparity.shape}")
    check_pixels(path, disparity.shape[0], disparity.shape[1], Png16Error)
    known = ~np.isnan(disparity)
    steps = np.rint(disparity.astype(np.float64) * scale)
    if (disparity[known] < 0).any() or (steps[known] > _LARGEST).any():
        raise Png16Error(
            f"{path}: values from {disparity[known].min():g} to {disparity[known].max():g}; the format holds "
            f"0 to {_LARGEST / scale:g}; write PFM instead"
        )
    stored = np.where(known, np.maximum(steps, 1), 0).astype(np.uint16)
    with atomic_write(path) as file:
        Image.fromarray(stored).save(file, "PNG", pnginfo=_texts(about or {}), compress_level=PNG_LEVEL)


def _texts(about: Mapping[str, str]) -> "PngInfo":
    from PIL.PngImagePlugin import PngInfo

    texts = PngInfo()
    for name, text in about.items():
        texts.add_text(name, text)
    return texts
