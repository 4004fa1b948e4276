"""Read Middlebury's ``calib.txt``, which ETH3D uses too.

::

    cam0=[994.978 0 311.193; 0 994.978 254.877; 0 0 1]      3 x 3 camera matrices: focal length and principal point
    cam1=[994.978 0 342.279; 0 994.978 254.877; 0 0 1]
    doffs=31.086                                            difference of the principal points' columns, pixels
    baseline=193.001                                        millimetres
    width=741
    height=500
    ndisp=70                                                disparities to search: 0 to ndisp - 1

Spaces around names, signs and values are allowed. Other names (``isint``, ``vmin``, ``dymax``, ...) are passed over.
Source: https://vision.middlebury.edu/stereo/data/scenes2014/
"""

import math
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from semidense.datasets.errors import CalibrationError, MissingFileError
from semidense.datasets.scene import Calibration

_LARGEST_FILE = 1 << 16
_Value = TypeVar("_Value")


@dataclass(frozen=True)
class CalibrationFile:
    """Hold what a ``calib.txt`` says.

    Attributes:
        calibration: Focal length and principal point of the left camera, baseline and ``doffs``.
        size: Rows and columns of the images.
        ndisp: Number of disparities to search, from 0 on.
    """

    calibration: Calibration
    size: tuple[int, int]
    ndisp: int


def read_calib(path: str | os.PathLike[str]) -> CalibrationFile:
    """Read a ``calib.txt``.

    Raises:
        MissingFileError: If there is no such file.
        CalibrationError: If an entry is missing, given twice or not valid; the line is named.
    """
    path = Path(path)
    entries = _Entries(path, _entries(path))
    focal, *centre = entries.get("cam0", _camera, "a 3 x 3 matrix [f 0 cx; 0 f cy; 0 0 1] with f above 0")
    return CalibrationFile(
        Calibration(
            focal,
            entries.get("baseline", _positive, "a number above 0"),
            entries.get("doffs", _number, "a number"),
            (centre[0], centre[1]),
        ),
        (
            entries.get("height", _count, "a whole number above 0"),
            entries.get("width", _count, "a whole number above 0"),
        ),
        entries.get("ndisp", _count, "a whole number above 0"),
    )


@dataclass(frozen=True)
class _Entries:
    path: Path
    lines: Mapping[str, tuple[int, str]]

    def get(self, name: str, convert: Callable[[str], _Value], expected: str) -> _Value:
        if name not in self.lines:
            raise CalibrationError(f"{self.path}: no line {name}=...; expected {expected}")
        number, text = self.lines[name]
        try:
            return convert(text)
        except ValueError as error:
            raise CalibrationError(f"{self.path}, line {number}: {name}={text}; expected {expected}") from error


def _entries(path: Path) -> dict[str, tuple[int, str]]:
    entries: dict[str, tuple[int, str]] = {}
    for number, line in enumerate(_text(path).splitlines(), start=1):
        name, sign, value = (part.strip() for part in line.partition("="))
        if not line.strip():
            continue
        if not (name and sign and value):
            raise CalibrationError(f"{path}, line {number}: {line.strip()[:60]!r}; expected name=value")
        if name in entries:
            raise CalibrationError(f"{path}, line {number}: {name} is given twice, first in line {entries[name][0]}")
        entries[name] = (number, value)
    return entries


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST_FILE + 1)
    except OSError as error:
        raise MissingFileError(f"{path}: cannot be read ({error.strerror})") from error
    if len(content) > _LARGEST_FILE or not content.isascii():
        raise CalibrationError(f"{path}: not plain text of at most {_LARGEST_FILE:,} bytes; the file is no calib.txt")
    return content.decode("ascii")


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def _positive(text: str) -> float:
    value = _number(text)
    if value <= 0:
        raise ValueError(text)
    return value


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise ValueError(text)
    return value


def _camera(text: str) -> tuple[float, float, float]:
    inside = re.fullmatch(r"\[(.*)\]", text)
    rows = [row.split() for row in inside[1].split(";")] if inside else []
    if [len(row) for row in rows] != [3, 3, 3]:
        raise ValueError(text)
    matrix = [[_number(item) for item in row] for row in rows]
    return _positive(str(matrix[0][0])), matrix[0][2], matrix[1][2]
