"""Read a disparity map that another program made, whatever its file says or does not say of scale, sign and none.

PFM, PNG, TIFF and NumPy files (.npy) hold numbers; what they mean differs. A `Reading` says it, or it is recognised:

- Scale: floating point numbers are pixels, signed 16-bit integers are OpenCV's (16 to a pixel), unsigned ones KITTI's
  (256) or OpenCV's, whichever gives disparities that the image can have. Other integers, and what could be both, are
  refused.
- None: NaN and infinity; 0 in unsigned integers, and 65520 and 65535, as which -16 and -1 are stored there; of signed
  ones the least, if it is negative; of floating point numbers the only negative one, or 0 if the next lies above 1 px.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from semidense.datasets.arrays import DisparityMap, array_text
from semidense.datasets.errors import DatasetError, MissingFileError
from semidense.datasets.formats.images import read_image
from semidense.datasets.formats.pfm import read_pfm
from semidense.datasets.formats.tiff import read_tiff

Stored = NDArray[Any]
"""What is in a file: (y, x) of any numbers."""
_OPENCV, _KITTI = 16.0, 256.0
_WRAPPED = (65520, 65535)
"""What -16 and -1, OpenCV's and others' none, become in unsigned 16-bit integers."""
_HUGE = 1e12
"""Disparities, px, that no scale and no none explains, but bytes that were read in the wrong order do."""
_LEAST_SHARE, _LARGEST_SHARE = 0.01, 0.6
"""A map's largest disparity, as a share of the image's width, if the scale that was guessed is right."""


@dataclass(frozen=True)
class Reading:
    """Say what the numbers of a map mean.

    Attributes:
        scale: Stored value of 1 px; below 0 if the right pixel lies at ``x + |d|``. None: recognise it.
        none: Stored value of a pixel without a disparity, beside NaN and infinity. None: recognise it.

    Raises:
        DatasetError: If the scale is 0 or not finite.
    """

    scale: float | None = None
    none: float | None = None

    def __post_init__(self) -> None:
        if self.scale is not None and (not np.isfinite(self.scale) or self.scale == 0):
            raise DatasetError(
                f"scale={self.scale}: give the stored value of 1 px, such as 256; below 0 turns the sign"
            )


def read_map(path: Path, reading: Reading) -> DisparityMap:
    """Read a disparity map.

    Args:
        path: PFM, PNG, TIFF or NumPy file; its ending tells which.
        reading: What its numbers mean.

    Returns:
        (y, x) float32, pixels, ``x_right = x_left - d``; NaN where there is none.

    Raises:
        MissingFileError: If there is no such file.
        DatasetError: If it is no map, or what its numbers mean cannot be told.
    """
    stored = stored_map(path)
    scale = recognised_scale(str(path), stored) if reading.scale is None else reading.scale
    return disparities(str(path), stored, Reading(scale, reading.none))


def stored_map(path: Path) -> Stored:
    """Read the numbers of a map as they are stored; raises what `read_map` raises."""
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise DatasetError(f"{path}: no format of maps; give {', '.join(_READERS)}")
    return require_map(str(path), reader(path))


def require_map(what: str, stored: Stored) -> Stored:
    """Return the numbers of a map; raises `DatasetError` if they are no (rows, columns) of numbers."""
    if stored.ndim != 2 or stored.dtype.kind not in "fiu" or not stored.size:
        raise DatasetError(f"{what}: {array_text(stored)}; a disparity map is (rows, columns) of numbers")
    return stored


def disparities(what: str, stored: Stored, reading: Reading, signed: bool = True) -> DisparityMap:
    """Return what stored numbers mean, as `read_map`.

    Args:
        what: Names them in messages.
        stored: (y, x) of any numbers; a masked one has no disparity.
        reading: Its scale is known by now.
        signed: Whether the sign of the scale was given, so that negative disparities are meant.
    """
    scale = reading.scale or 1.0
    known = ~np.ma.getmaskarray(stored)
    scaled = np.full(stored.shape, np.nan)
    with np.errstate(over="ignore", invalid="ignore"):  # what is too large is refused below
        scaled[known] = _meant(np.ma.getdata(stored)[known], scale, reading.none)
    _require_possible(what, scaled)
    values = scaled.astype(np.float32)
    if not signed and np.nanmedian(values) < 0:
        raise DatasetError(
            f"{what}: most disparities are negative (median {np.nanmedian(values):.3g} px), and a right pixel lies at "
            f"x - d: give scale={-scale:g} to turn the sign, scale={scale:g} to keep it"
        )
    return values


def _meant(stored: Stored, scale: float, none: float | None) -> NDArray[np.float64]:
    """Return the disparities that stored numbers stand for, px; NaN for none."""
    missing = _missing(stored, scale) if none is None else stored == none
    return np.where(missing | ~np.isfinite(stored), np.nan, stored.astype(np.float64) / scale)


def _read_npy(path: Path) -> Stored:
    try:
        stored = np.array(open_memmap(path, mode="r"))  # unlike np.load, it takes .npy alone, and believes no size
    except OSError as error:
        raise MissingFileError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (ValueError, EOFError, SyntaxError, TokenError) as error:
        raise DatasetError(f"{path}: this is not a NumPy file (.npy) of numbers ({error})") from error
    return stored


_READERS: Mapping[str, Callable[[Path], Stored]] = {
    ".pfm": read_pfm,
    ".png": read_image,
    ".tif": read_tiff,
    ".tiff": read_tiff,
    ".npy": _read_npy,
}


def recognised_scale(what: str, stored: Stored) -> float:
    """Return the stored value of 1 px, if the type and the values that are not masked leave no doubt.

    Raises:
        DatasetError: If they do.
    """
    width, stored = stored.shape[1], np.ma.compressed(stored)
    if stored.dtype.kind == "f":
        return _scale_of_floats(what, stored, width)
    if stored.dtype == np.int16:
        return _OPENCV
    if stored.dtype != np.uint16:
        raise DatasetError(
            f"{what}: {stored.dtype} says nothing of the scale; give the stored value of 1 px: scale=..."
        )
    largest = stored[~np.isin(stored, _WRAPPED)].max(initial=0)
    low, high = (share * width for share in (_LEAST_SHARE, _LARGEST_SHARE))
    if (stored == _WRAPPED[0]).any() and largest / _OPENCV <= high:
        return _OPENCV
    fitting = [scale for scale in (_KITTI, _OPENCV) if low <= largest / scale <= high]
    if len(fitting) != 1:
        raise DatasetError(
            f"{what}: values up to {largest} in 16 bits are {largest / _KITTI:.3g} px as KITTI stores them (scale=256) "
            f"and {largest / _OPENCV:.3g} px as OpenCV does (scale=16); give one"
        )
    return fitting[0]


def _scale_of_floats(what: str, stored: Stored, width: int) -> float:
    largest = np.abs(stored[np.isfinite(stored)]).max(initial=0)
    if 0 < largest <= 1:
        raise DatasetError(
            f"{what}: the largest value is {largest:.3g}: are they shares of the width? give the stored value of 1 px: "
            f"then scale={1 / width:.3g}, else scale=1"
        )
    return 1.0


def _missing(stored: Stored, scale: float) -> NDArray[np.bool_]:
    """Return where a stored value means that there is no disparity."""
    if stored.dtype.kind == "u":
        wrapped = np.isin(stored, _WRAPPED) if stored.dtype == np.uint16 else np.zeros(stored.shape, bool)
        # OpenCV's zero is a disparity where its none shows beside it.
        is_disparity = abs(scale) == _OPENCV and bool(wrapped.any())
        return wrapped if is_disparity else np.logical_or(wrapped, _equal(stored, 0))
    if stored.dtype.kind == "i":
        return _equal(stored, stored.min(initial=-1))
    return _missing_of_floats(stored, scale)


def _equal(stored: Stored, value: float) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = stored == value
    return found


def _missing_of_floats(stored: Stored, scale: float) -> NDArray[np.bool_]:
    known = np.unique(stored[np.isfinite(stored)])
    negative, positive = known[known < 0], known[known > 0]
    missing = list(negative) if scale > 0 and len(negative) == 1 else []
    if len(negative) == len(missing) and _is_apart(positive, scale):
        missing.append(0)
    return np.isin(stored, missing)


def _is_apart(positive: Stored, scale: float) -> bool:
    """Return whether the least positive value is above 1 px: then 0 is no disparity among others."""
    return bool(len(positive)) and bool(positive[0] > abs(scale))


def _require_possible(what: str, values: Stored) -> None:
    """Refuse a map that no image can have."""
    known = values[~np.isnan(values)]
    if not known.size:
        raise DatasetError(f"{what}: no pixel has a disparity")
    if not known.any():
        raise DatasetError(f"{what}: all disparities are 0, as in a map that nobody filled")
    if (largest := np.abs(known).max()) >= values.shape[1]:
        order = ", or the file has the other byte order" if largest > _HUGE else ""
        raise DatasetError(
            f"{what}: a disparity of {largest:.6g} px in an image of {values.shape[1]} px; give the stored value of 1 "
            f"px (OpenCV: scale=16, KITTI: scale=256) and the one that means none (such as none=-1){order}"
        )
