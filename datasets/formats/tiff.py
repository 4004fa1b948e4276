"""Write maps as float TIFF: 32-bit floats without compression, NaN for none; and read those of other programs."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from semidense.datasets.errors import ImageError, MissingFileError
from semidense.datasets.formats.atomic import atomic_write
from semidense.datasets.formats.files import open_file
from semidense.datasets.formats.limits import check_pixels

_PHOTOMETRIC, _WHITE_IS_ZERO = 0x0106, 0
_SAMPLE_FORMAT, _SIGNED = 0x0153, 2
_BITS_PER_SAMPLE, _SHORT = 0x0102, 16


def write_tiff(
    path: str | os.PathLike[str],
    values: np.ndarray[tuple[int, ...], np.dtype[np.floating]],
    about: Mapping[str, Any] | None = None,
) -> None:
    """Write a map as a TIFF of one 32-bit float band, atomically.

    Args:
        path: Where to; an existing file is replaced.
        values: (y, x) float; stored as float32, NaN as NaN.
        about: What the file is, stored as JSON in the tag ImageDescription.

    Raises:
        ImageError: If the array is not a float map of (y, x), or is empty.
        OSError: If the file cannot be written.
    """
    from PIL import Image  # here, as few who import this write

    path, values = Path(path), np.asarray(values)
    if values.ndim != 2 or values.dtype.kind != "f":
        raise ImageError(f"{path}: give a float array of (rows, columns), not {values.dtype} of {values.shape}")
    check_pixels(path, values.shape[0], values.shape[1], ImageError)
    with atomic_write(path) as file:
        Image.fromarray(values.astype(np.float32)).save(file, "TIFF", description=json.dumps(about or {}))


def read_tiff(path: str | os.PathLike[str]) -> np.ndarray[tuple[int, ...], np.dtype[Any]]:
    """Read a TIFF of one band of numbers.

    Returns:
        (y, x): float32, int32, int16, uint16 or uint8, as stored.

    Raises:
        MissingFileError: If there is no such file.
        ImageError: If it is no such TIFF, or above `MAX_PIXELS`.
    """
    from PIL import Image, UnidentifiedImageError

    path = Path(path)
    try:
        with open_file(path) as file, Image.open(file, formats=["TIFF"]) as image:
            check_pixels(path, image.height, image.width, ImageError)
            tags = image.getexif()
            signed = _SIGNED in np.atleast_1d(tags.get(_SAMPLE_FORMAT, 1))
            if (signed and image.mode == "L") or tags.get(_PHOTOMETRIC) == _WHITE_IS_ZERO:
                raise ImageError(f"{path}: values of 8 bits with a sign, or white as 0; save 32-bit floats or 16 bits")
            if len(image.getbands()) != 1 or getattr(image, "n_frames", 1) != 1:
                raise ImageError(f"{path}: {len(image.getbands())} bands; a map is one band of one image")
            values = np.array(image)  # 32 bits for 16 with a sign
            return values.astype(np.int16) if signed and _SHORT in np.atleast_1d(tags[_BITS_PER_SAMPLE]) else values
    except UnidentifiedImageError as error:
        raise ImageError(f"{path}: no TIFF that can be read; save 32-bit floats without compression") from error
    except (OSError, ValueError, SyntaxError) as error:
        raise (
            error if isinstance(error, ImageError | MissingFileError) else ImageError(f"{path}: damaged TIFF ({error})")
        ) from error
