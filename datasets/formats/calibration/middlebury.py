"""Read Middlebury's ``calib.txt``, which ETH3D uses too.

::

    cam0=[994.978 0 311.193; 0 994.978 254.877; 0 0 1]      3 x 3 camera matrices: focal length and principal point
    cam1=[994.978 0 342.279; 0 994.978 254.877; 0 0 1]
    doffs=31.086                                            difference of the principal points' columns, pixels
    baseline=193.001                                        millimetres
    width=741
    height=500
    ndisp=70                                                disparities to search: 0 to ndisp - 1

Spaces around names, signs and values are allowed, and comments after a ``#``. Other names (``isint``, ``vmin``,
``dymax``, ...) are passed over. Without ``cam1`` the right camera is ``cam0`` moved by ``doffs``. A calibration that
people write themselves may lack ``doffs`` if it has ``cam1``, and the size and ``ndisp``.
Source: https://vision.middlebury.edu/stereo/data/scenes2014/
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semidense.datasets.formats.calibration.cameras import Cameras, calibrated
from semidense.datasets.formats.calibration.text import (
    CAMERA,
    Matrix,
    NamedLines,
    camera,
    count,
    named_lines,
    number,
    positive,
    read_text,
)
from semidense.datasets.scene import Calibration

_COUNT = "a whole number above 0"


@dataclass(frozen=True)
class CalibrationFile:
    """Hold what a ``calib.txt`` says.

    Attributes:
        calibration: Focal lengths and principal point of the left camera, baseline and ``doffs``.
        size: Rows and columns of the images.
        ndisp: Number of disparities to search, from 0 on.
        warnings: What contradicts itself in the file, a line each.
    """

    calibration: Calibration
    size: tuple[int, int]
    ndisp: int
    warnings: tuple[str, ...] = ()


def read_calib(path: str | os.PathLike[str]) -> CalibrationFile:
    """Read a ``calib.txt``.

    Raises:
        MissingFileError: If there is no such file.
        CalibrationError: If an entry is missing, given twice or not valid; the line is named.
    """
    path = Path(path)
    entries = named_lines(path, read_text(path))
    known = calibrated(middlebury_cameras(entries))
    entries.get("doffs", number, "a number")
    return CalibrationFile(known.calibration, _size(entries), _ndisp(entries), known.warnings)


def middlebury_cameras(entries: NamedLines) -> Cameras:
    """Return what the lines of a ``calib.txt`` say; raises what `read_calib` raises."""
    left = entries.get("cam0", camera, CAMERA)
    baseline = entries.get("baseline", positive, "a number above 0")
    doffs = None if _lacks(entries, "doffs") and "cam1" in entries.lines else entries.get("doffs", number, "a number")
    right = left + _moved(doffs or 0) if _lacks(entries, "cam1") else entries.get("cam1", camera, CAMERA)
    return Cameras(
        entries.path,
        np.column_stack([left, np.zeros(3)]),
        np.column_stack([right, [-left[0, 0] * baseline, 0, 0]]),
        "mm",
        None if _lacks(entries, "width", "height") else _size(entries),
        None if _lacks(entries, "ndisp") else _ndisp(entries),
        doffs,
    )


def _lacks(entries: NamedLines, *names: str) -> bool:
    """Tell whether a file has no line of these names."""
    return not set(names) & entries.lines.keys()


def _moved(doffs: float) -> Matrix:
    change = np.zeros((3, 3))
    change[0, 2] = doffs
    return change


def _size(entries: NamedLines) -> tuple[int, int]:
    return entries.get("height", count, _COUNT), entries.get("width", count, _COUNT)


def _ndisp(entries: NamedLines) -> int:
    return entries.get("ndisp", count, _COUNT)
