"""Read a ``K.txt``: nothing but numbers, the nine of the camera matrix row by row, then the baseline in metres.

::

    754.6680 0.0 489.3794 0.0 754.6680 265.1617 0.0 0.0 1.0
    0.0630

Both views share the principal point. The numbers may stand on any lines; comments follow a ``#``.
"""

import math
from pathlib import Path

import numpy as np

from semidense.datasets.errors import CalibrationError
from semidense.datasets.formats.calibration.cameras import Cameras
from semidense.datasets.formats.calibration.text import matrix, without_comments


def numbers_only(text: str) -> list[float]:
    """Return a text's numbers, or nothing if it holds anything else but comments."""
    try:
        return [float(item) for item in without_comments(text).replace(",", " ").split()]
    except ValueError:
        return []


def intrinsics_cameras(path: Path, numbers: list[float]) -> Cameras:
    """Return what the numbers say.

    Raises:
        CalibrationError: If they are not ten, or the baseline is not finite and above 0.
    """
    if len(numbers) != 10:
        raise CalibrationError(f"{path}: {len(numbers)} numbers; expected nine of the camera matrix and the baseline")
    if not (math.isfinite(numbers[9]) and numbers[9] > 0):
        raise CalibrationError(f"{path}: a baseline of {numbers[9]:g}; expected a number of metres, above 0")
    shared = matrix(path, "the camera matrix", numbers[:9], (3, 3))
    left, right = (np.column_stack([shared, [shift, 0, 0]]) for shift in (0, -shared[0, 0] * numbers[9]))
    return Cameras(path, left, right, "m")
