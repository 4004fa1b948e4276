"""Read and write disparity maps as PFM, the float format of Middlebury and ETH3D.

Three header lines (``Pf``, ``columns rows``, ``scale``), then rows of 32-bit floats from the bottom row to the top.
Only the scale's SIGN counts: below 0 means little-endian, above 0 big-endian. Its size is no factor of the values.
Source: http://netpbm.sourceforge.net/doc/pfm.html
"""

import math
import os
from pathlib import Path
from typing import BinaryIO

import numpy as np

from semidense.datasets.arrays import DisparityMap
from semidense.datasets.errors import PfmError
from semidense.datasets.formats.atomic import atomic_write
from semidense.datasets.formats.files import as_missing, open_file
from semidense.datasets.formats.limits import check_pixels

_LONGEST_LINE = 80


def read_pfm(path: str | os.PathLike[str]) -> DisparityMap:
    """Read a one-channel PFM.

    Returns:
        (y, x) float32, top row first; infinite values come back as NaN (unknown), negative ones as they are.

    Raises:
        MissingFileError: If there is no such file.
        PfmError: If it is a colour PFM, or its header, size or length is wrong.
    """
    path = Path(path)
    try:
        with open_file(path) as file:
            return _read(file, path)
    except OSError as error:
        raise as_missing(path, error) from error


def write_pfm(path: str | os.PathLike[str], array: np.ndarray[tuple[int, ...], np.dtype[np.floating]]) -> None:
    """Write a disparity map as a little-endian PFM, atomically; NaN is stored as infinity.

    Args:
        path: Where to; an existing file is replaced.
        array: (y, x), any float dtype; values are stored as float32.

    Raises:
        PfmError: If the array is not a float map of (y, x), is empty, or holds values that float32 cannot.
        OSError: If the file cannot be written.
    """
    path, array = Path(path), np.asarray(array)
    if array.ndim != 2 or array.dtype.kind != "f":
        raise PfmError(f"{path}: PFM takes a float array of (rows, columns), not {array.dtype} of shape {array.shape}")
    rows, columns = array.shape
    check_pixels(path, rows, columns, PfmError)
    with np.errstate(over="ignore"):
        stored = array.astype("<f4")
    if np.isfinite(array).sum() != np.isfinite(stored).sum():
        raise PfmError(f"{path}: values above float32's largest ({np.finfo(np.float32).max:.3g}) cannot be stored")
    stored[~np.isfinite(stored)] = np.inf
    with atomic_write(path) as file:
        file.write(f"Pf\n{columns} {rows}\n-1.0\n".encode("ascii"))
        file.write(stored[::-1].tobytes())


def _read(file: BinaryIO, path: Path) -> DisparityMap:
    _check_magic(_line(file, path, "magic"), path)
    rows, columns = _parse_size(_line(file, path, "size"), path)
    byte_order = _parse_scale(_line(file, path, "scale"), path)
    _check_length(file, path, rows, columns)
    values = np.frombuffer(file.read(), dtype=f"{byte_order}f4").reshape(rows, columns)
    disparity = values[::-1].astype(np.float32)
    disparity[np.isinf(disparity)] = np.nan
    return disparity


def _line(file: BinaryIO, path: Path, what: str) -> str:
    line = file.readline(_LONGEST_LINE)
    if not line.endswith(b"\n"):
        raise PfmError(f"{path}: no {what} line in the PFM header; the file is no PFM, or is cut off")
    return line.decode("ascii", errors="replace").strip()


def _check_magic(magic: str, path: Path) -> None:
    if magic == "PF":
        raise PfmError(f"{path}: a colour PFM (magic PF); a disparity map has one channel (magic Pf)")
    if magic != "Pf":
        raise PfmError(f"{path}: starts with {magic!r}, not with Pf; the file is no PFM")


def _parse_size(line: str, path: Path) -> tuple[int, int]:
    fields = line.split()
    if len(fields) != 2 or not all(field.isascii() and field.isdecimal() for field in fields):
        raise PfmError(f"{path}: size line {line!r}; expected two whole numbers, columns and rows")
    columns, rows = map(int, fields)
    check_pixels(path, rows, columns, PfmError)
    return rows, columns


def _parse_scale(line: str, path: Path) -> str:
    try:
        scale = float(line)
    except ValueError:
        scale = math.nan
    if not math.isfinite(scale) or scale == 0:
        raise PfmError(
            f"{path}: scale line {line!r}; expected a number below 0 (little-endian) or above 0 (big-endian)"
        )
    return "<" if scale < 0 else ">"


def _check_length(file: BinaryIO, path: Path, rows: int, columns: int) -> None:
    found = os.fstat(file.fileno()).st_size - file.tell()
    expected = rows * columns * 4
    if found != expected:
        state = "truncated" if found < expected else "followed by trailing bytes"
        raise PfmError(f"{path}: {state}: {found:,} bytes of pixels, expected {rows} x {columns} x 4 = {expected:,}")
