"""Say what is known of pairs beside their images, and write it into a specification that is read back."""

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from numbers import Real
from os import PathLike, fspath
from typing import Any, TypeAlias

from semidense.datasets.errors import DatasetError
from semidense.datasets.formats.calibration.cameras import require_unit

SPLITS = ("side-by-side", "over-under")
"""How one picture may hold both views: left and right halves, or upper (left view) and lower (right view)."""
PATTERN = "pair:LEFT,RIGHT or pair:LIST.csv or pair:FILE,split=side-by-side or pair:LEFT,disparity=FILE"
_LINE_END = "\r\n"
_Specification: TypeAlias = tuple[list[str], "PairOptions"]


@dataclass(frozen=True)
class PairOptions:
    """Say what is known of pairs beside their images.

    Attributes:
        calib: Calibration files, one or a left and a right one; they replace those that a list names.
        unit: Their unit of length: mm, cm or m.
        d_min: Smallest disparity to search, pixels.
        d_max: Largest one.
        split: How one picture holds both views: one of `SPLITS`; None if each view has its own file.
        costs: A cost volume (y, x, d) of the pair, which takes the place of the matching-Net's: NumPy, Zarr or NetCDF;
            its first disparity is its coordinate ``d``, else ``d_min``, else 0.
        disparity: A file with a disparity map of the left view, which takes the place of the raw disparity.
        scale: Stored value of 1 px in that file; None: recognised.
        none: Stored value of its pixels without a disparity; None: recognised. NaN and infinity mean None.

    Raises:
        DatasetError: If ``split`` or ``unit`` is not known, or a number is none.
    """

    calib: tuple[str, ...] = ()
    unit: str | None = None
    d_min: int | None = None
    d_max: int | None = None
    split: str | None = None
    costs: str | None = None
    disparity: str | None = None
    scale: float | None = None
    none: float | None = None

    def __post_init__(self) -> None:
        if self.split is not None and self.split not in SPLITS:
            raise DatasetError(f"split={self.split}: not known; give {' or '.join(SPLITS)}")
        require_unit(self.unit)
        for key in ("d_min", "d_max"):
            object.__setattr__(self, key, _pixels(key, getattr(self, key)))
        for key in ("scale", "none"):
            object.__setattr__(self, key, _stored(key, getattr(self, key)))
        if self.none is not None and not math.isfinite(self.none):
            object.__setattr__(self, "none", None)


def _pixels(key: str, given: object) -> int | None:
    if isinstance(given, Real) and not isinstance(given, bool) and float(given).is_integer():
        return int(float(given))
    if given is not None:
        raise DatasetError(f"{key} = {given!r}: give a whole number of pixels")
    return None


def _stored(key: str, given: object) -> float | None:
    if isinstance(given, Real) and not isinstance(given, bool):
        return float(given)
    if given is not None:
        raise DatasetError(f"{key} = {given!r}: give a number")
    return None


def file_names(given: object) -> tuple[str, ...]:
    """Return the names of the files that a user gave as one, several or, as None, none.

    Raises:
        DatasetError: If it is something else.
    """
    if given is None or isinstance(given, str | PathLike):
        return () if given is None else (fspath(given),)
    if isinstance(given, Sequence) and all(isinstance(each, str | PathLike) for each in given):
        return tuple(map(fspath, given))
    raise DatasetError(f"calib = {given!r}: give the path of a calibration file, or of several")


_KEYS = tuple(field.name for field in fields(PairOptions))


def pair_spec(sides: Sequence[str], options: PairOptions) -> str:
    """Write a specification that `parse` reads back, whatever the names of the files are.

    >>> pair_spec(["a.png", "b, c.png"], PairOptions(d_max=63))
    'pair:a.png,"b, c.png",d_max=63'
    >>> pair_spec(["calib=1.png", "b.png"], PairOptions())
    'pair:./calib=1.png,b.png'
    """
    named = [(key, getattr(options, key)) for key in _KEYS if key != "calib"]
    given = [f"calib={name}" for name in options.calib]
    given += [f"{key}={value}" for key, value in named if value is not None]
    text = io.StringIO()
    # A field is put in quotes if it holds a character of the line's end: so a name may have a line break.
    csv.writer(text, lineterminator=_LINE_END).writerow([*map(_as_path, sides), *given])
    return "pair:" + text.getvalue().removesuffix(_LINE_END)


def parse(argument: str) -> _Specification:
    """Read the paths and the options of the text after ``pair:``.

    Raises:
        DatasetError: If it cannot be understood.
    """
    sides, options = [], PairOptions()
    for item in next(csv.reader(io.StringIO(argument, newline="")), []):
        key, sign, value = item.partition("=")
        if sign and key in _KEYS:
            options = _with(options, key, value)
        else:
            sides.append(item)
    if not all(sides) or len(sides) not in (1, 2):
        raise DatasetError(f"pair:{argument}: {_unknown(sides)}; write {PATTERN}")
    return sides, options


def _unknown(sides: Sequence[str]) -> str:
    """Say what is wrong with too many paths, or too few."""
    keys = (side.partition("=")[0] for side in sides if "=" in side)
    key = next(filter(str.isidentifier, keys), None)
    told = f"{key} is not known; known are {', '.join(_KEYS)}" if key else f"{len(sides)} paths"
    return f"{told}; a path with a comma stands in double quotes"


def _as_path(side: str) -> str:
    """Put ``./`` before a path that would read as an option."""
    return f"./{side}" if side.partition("=")[0] in _KEYS and "=" in side else side


def _with(options: PairOptions, key: str, value: str) -> PairOptions:
    if key == "calib":
        return replace(options, calib=(*options.calib, value))
    changed: dict[str, Any] = {key: _READ.get(key, _text)(key, value)}
    return replace(options, **changed)


def _text(_: str, value: str) -> str:
    return value


def _whole(key: str, value: str) -> int:
    try:
        return int(value)
    except ValueError as error:
        raise DatasetError(f"pair: {key}={value}; expected a whole number of pixels") from error


def _number(key: str, value: str) -> float:
    try:
        return float(value)
    except ValueError as error:
        raise DatasetError(f"pair: {key}={value}; expected a number") from error


_READ: Mapping[str, Callable[[str, str], Any]] = {"d_min": _whole, "d_max": _whole, "scale": _number, "none": _number}
"""How the options that are numbers are read."""
