"""Read a calibration file as text, and the names, numbers and matrices in it."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from semidense.datasets.errors import CalibrationError
from semidense.datasets.formats import files

Matrix: TypeAlias = NDArray[np.float64]
_LARGEST_FILE = 1 << 18
_Value = TypeVar("_Value")


def read_text(path: Path) -> str:
    r"""Read a small text file, with ``\n`` at every line's end.

    Raises:
        MissingFileError: If it cannot be read.
        CalibrationError: If it is larger than 262,144 bytes or no text.
    """
    text = files.read_text(path, _LARGEST_FILE, CalibrationError, "calibration")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def without_comments(text: str) -> str:
    """Return a text without what follows a ``#`` in a line."""
    return re.sub(r"#.*", "", text)


@dataclass(frozen=True)
class NamedLines:
    """Hold the lines ``name=value`` of a file.

    Attributes:
        path: The file, for messages.
        lines: Line number and value of each name.
    """

    path: Path
    lines: Mapping[str, tuple[int, str]]

    def get(self, name: str, convert: Callable[[str], _Value], expected: str) -> _Value:
        """Convert a value.

        Raises:
            CalibrationError: If the name is missing, or its value is not what is expected.
        """
        if name not in self.lines:
            raise CalibrationError(f"{self.path}: no line {name}=...; expected {expected}")
        number, text = self.lines[name]
        try:
            return convert(text)
        except ValueError as error:
            raise CalibrationError(f"{self.path}, line {number}: {name}={text}; expected {expected}") from error


def named_lines(path: Path, text: str) -> NamedLines:
    """Split text into ``name=value``; empty lines, and what follows a ``#``, are passed over.

    Raises:
        CalibrationError: If a line is anything else, or a name is given twice; the line is named.
    """
    entries: dict[str, tuple[int, str]] = {}
    for number, line in enumerate(without_comments(text).splitlines(), start=1):
        content = line.strip()
        name, sign, value = (part.strip() for part in content.partition("="))
        if not content:
            continue
        if not (name and sign and value):
            raise CalibrationError(f"{path}, line {number}: {content[:60]!r}; expected name=value")
        if name in entries:
            raise CalibrationError(f"{path}, line {number}: {name} is given twice, first in line {entries[name][0]}")
        entries[name] = (number, value)
    return NamedLines(path, entries)


def number(text: str) -> float:
    """Convert to a finite number; raises `ValueError` for anything else."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def positive(text: str) -> float:
    """Convert to a finite number above 0; raises `ValueError` for anything else."""
    value = number(text)
    if value <= 0:
        raise ValueError(text)
    return value


def count(text: str) -> int:
    """Convert to a whole number above 0; raises `ValueError` for anything else."""
    value = int(text)
    if value < 1:
        raise ValueError(text)
    return value


CAMERA = "a 3 x 3 matrix [fx s cx; 0 fy cy; 0 0 1] with fx and fy above 0"
"""What `camera` expects, for messages."""


def camera(text: str) -> Matrix:
    """Convert ``[fx s cx; 0 fy cy; 0 0 1]`` to a 3 x 3 matrix; raises `ValueError` for anything else."""
    inside = re.fullmatch(r"\[(.*)\]", text)
    rows = [row.replace(",", " ").split() for row in inside[1].split(";")] if inside else []
    if [len(row) for row in rows] != [3, 3, 3]:
        raise ValueError(text)
    matrix = np.array([[number(item) for item in row] for row in rows])
    if matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
        raise ValueError(text)
    return matrix


def matrix(path: Path, name: str, data: object, shape: tuple[int, int]) -> Matrix:
    """Convert numbers, flat or nested, to a matrix.

    Raises:
        CalibrationError: If they are too few or too many, or not finite numbers.
    """
    values = floats(data)
    if values.size != math.prod(shape) or not np.isfinite(values).all():
        raise CalibrationError(f"{path}: {name} is no matrix of {shape[0]} x {shape[1]} numbers")
    return values.reshape(shape)


def sides(path: Path, name: str, values: Matrix) -> tuple[int, int]:
    """Return the two sides of an image; raises `CalibrationError` if they are no whole numbers above 0."""
    first, second = values.ravel().tolist()
    if not (first >= 1 and second >= 1 and first == int(first) and second == int(second)):
        raise CalibrationError(f"{path}: {name} is {first:g} x {second:g}; expected whole numbers of pixels")
    return int(first), int(second)


def floats(data: object) -> Matrix:
    """Return numbers of any nesting, flat; nothing if one of them is no number, as ``true`` is none."""
    try:
        cells = np.array(data, object).ravel()
        return np.empty(0) if any(isinstance(cell, bool) for cell in cells) else cells.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)
