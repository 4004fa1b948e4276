"""Write maps as float TIFF: 32-bit floats without compression, NaN for none, what they are in the description."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from semidense.datasets.errors import ImageError
from semidense.datasets.formats.atomic import atomic_write
from semidense.datasets.formats.limits import check_pixels


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
