"""Take a user's own rectified pairs: two files, two folders, two patterns, or a list.

``pair:LEFT,RIGHT[,KEY=VALUE...]`` or ``pair:LIST.csv[,KEY=VALUE...]``; a path with a comma stands in double quotes::

    pair:left.png,right.png                                   one pair; its range is estimated from the images
    pair:left.png,right.png,d_min=0,d_max=63                  one pair, its range known
    pair:camera/left,camera/right,calib=calib.txt             two folders, paired by name
    pair:shot*_L.jpg,shot*_R.jpg,calib=l.yaml,calib=r.yaml    two patterns, a ROS calibration
    pair:pairs.csv                                            lines left,right[,calibration]

``calib`` is what `semidense.datasets.formats.cameras` reads, ``unit`` its unit of length (mm, cm, m). A range comes
from ``d_min`` and ``d_max``, else from a ``calib.txt``; an end that neither gives is left open for an estimate.
"""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from semidense.datasets.errors import CalibrationError, DatasetError
from semidense.datasets.formats.cameras import PairCalibration, read_cameras
from semidense.datasets.formats.images import image_size
from semidense.datasets.pairs.pairing import LISTS, Pair, find_pairs, read_list
from semidense.datasets.scene import DisparityRange, RangeEnd, SceneSource

_PATTERN = "pair:LEFT,RIGHT or pair:LIST.csv"


@dataclass(frozen=True)
class PairOptions:
    """Say what is known of pairs beside their images.

    Attributes:
        calib: Calibration files, one or a left and a right one; they replace those that a list names.
        unit: Their unit of length.
        d_min: Smallest disparity to search, pixels.
        d_max: Largest one.
    """

    calib: tuple[str, ...] = ()
    unit: str | None = None
    d_min: int | None = None
    d_max: int | None = None


def pair_spec(sides: Sequence[str], options: PairOptions) -> str:
    """Write a specification that `list_scenes` reads back.

    >>> pair_spec(["a.png", "b, c.png"], PairOptions(d_max=63))
    'pair:a.png,"b, c.png",d_max=63'
    """
    named = [("unit", options.unit), ("d_min", options.d_min), ("d_max", options.d_max)]
    given = [f"calib={name}" for name in options.calib] + [
        f"{key}={value}" for key, value in named if value is not None
    ]
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow([*sides, *given])
    return f"pair:{text.getvalue()}"


def list_scenes(argument: str) -> tuple[SceneSource, ...]:
    """List the pairs that the text after the colon names.

    Raises:
        DatasetError: If it cannot be understood, or a file is missing or not valid.
    """
    sides, options = _parsed(argument)
    pairs = _listed(sides)
    known = {
        files: read_cameras(files, options.unit) for files in {_calib_files(pair, options) for pair in pairs} if files
    }
    return tuple(_source(pair, options, known.get(_calib_files(pair, options))) for pair in pairs)


def _parsed(argument: str) -> tuple[list[str], PairOptions]:
    sides, given = [], PairOptions()
    for item in next(csv.reader([argument]), []):
        key, sign, value = item.partition("=")
        if not sign or key not in PairOptions.__dataclass_fields__:
            sides.append(item)
        else:
            given = _with(given, key, value)
    if not all(sides) or len(sides) not in (1, 2):
        raise DatasetError(f"pair:{argument}: {len(sides)} paths; write {_PATTERN}")
    return sides, given


def _with(options: PairOptions, key: str, value: str) -> PairOptions:
    if key == "calib":
        return PairOptions((*options.calib, value), options.unit, options.d_min, options.d_max)
    try:
        new = value if key == "unit" else int(value)
    except ValueError as error:
        raise DatasetError(f"pair: {key}={value}; expected a whole number of pixels") from error
    return PairOptions(**{**vars(options), key: new})


def _listed(sides: list[str]) -> list[Pair]:
    if len(sides) == 2:
        return find_pairs(*sides)
    path = Path(sides[0]).expanduser()
    if path.suffix.lower() not in LISTS:
        raise DatasetError(f"{path}: one path alone must be a list ({', '.join(LISTS)}); write {_PATTERN}")
    return read_list(path)


def _calib_files(pair: Pair, options: PairOptions) -> tuple[Path, ...]:
    return tuple(Path(name).expanduser() for name in options.calib) or pair.calib


def _source(pair: Pair, options: PairOptions, known: PairCalibration | None) -> SceneSource:
    size, other = image_size(pair.left), image_size(pair.right)
    if other != size:
        raise DatasetError(
            f"{pair.right}: {other[0]} x {other[1]} pixels, but {pair.left} has {size[0]} x {size[1]}; both must agree"
        )
    files = {"left": pair.left, "right": pair.right}
    return SceneSource(**described(pair.name, size, options, known), files=files)


def described(name: str, size: tuple[int, int], options: PairOptions, known: PairCalibration | None) -> dict[str, Any]:
    """Return what a scene's source says beside its files: the keyword arguments of `SceneSource`.

    Args:
        name: The scene's name.
        size: Rows and columns.
        options: What the user gave.
        known: What a calibration tells.

    Raises:
        CalibrationError: If the calibration is of another size.
        DatasetError: If the range is empty or wider than the image.
    """
    if known and known.size and known.size != size:
        raise CalibrationError(
            f"{name}: the calibration is of {known.size[0]} x {known.size[1]} pixels, the images have "
            f"{size[0]} x {size[1]}; take the calibration of this resolution"
        )
    disparities, open_ends = _range(size[1], options, known)
    return {
        "name": name,
        "dataset": "pair",
        "split": "test",
        "size": size,
        "disparities": disparities,
        "reader": "semidense.datasets.pairs.images",
        "calibration": known.calibration if known else None,
        "open_ends": open_ends,
    }


def _range(
    width: int, options: PairOptions, known: PairCalibration | None
) -> tuple[DisparityRange, tuple[RangeEnd, ...]]:
    """Return the range to search, and which of its ends only the image's width bounds."""
    # ETH3D's ``ndisp`` is the image's width: it bounds nothing.
    told = known.ndisp if known and known.ndisp and known.ndisp < width else None
    low = options.d_min if options.d_min is not None else 0 if told else None
    high = options.d_max if options.d_max is not None else told - 1 if told else None
    for key, value in (("d_min", low), ("d_max", high)):
        if value is not None and abs(value) >= width:
            raise DatasetError(f"pair: {key}={value}, but the image is only {width} px wide")
    open_ends: list[RangeEnd] = []
    open_ends += ["minimum"] if low is None else []
    open_ends += ["maximum"] if high is None else []
    return DisparityRange(1 - width if low is None else low, width - 1 if high is None else high), tuple(open_ends)
