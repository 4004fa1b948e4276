"""Take a user's own rectified pairs: two files, two folders, two patterns, a list, or pictures that hold both views.

``pair:LEFT,RIGHT[,KEY=VALUE...]`` or ``pair:LIST.csv[,KEY=VALUE...]``; a path with a comma stands in double quotes::

    pair:left.png,right.png                                   one pair; its range is estimated from the images
    pair:left.png,right.png,d_min=0,d_max=63                  one pair, its range known
    pair:camera/left,camera/right,calib=calib.txt             two folders, paired by name
    pair:shot*_L.jpg,shot*_R.jpg,calib=l.yaml,calib=r.yaml    two patterns, a ROS calibration
    pair:left.png,right.png,d_min=0,costs=volume.npy          one pair, with the costs of another matcher (y, x, d)
    pair:left.png,right.png,disparity=map.png,scale=256       one pair, with the disparity map of another matcher
    pair:left.png,disparity=map.pfm                           the same, without its right view
    pair:pairs.csv                                            lines left,right[,calibration]
    pair:video/,split=side-by-side                            every picture holds both views; or over-under

``calib`` is what `semidense.datasets.formats.calibration.reading` reads, ``unit`` its unit of length (mm, cm, m). A
range comes from ``d_min`` and ``d_max``; its upper end else from a ``calib.txt``. An end that nothing gives is left
open for an estimate: a calibration does not know whether disparities are negative.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

from semidense.datasets.errors import DatasetError
from semidense.datasets.formats.calibration.cameras import PairCalibration
from semidense.datasets.formats.calibration.reading import read_cameras
from semidense.datasets.formats.costs import costs_header
from semidense.datasets.formats.files import user_path
from semidense.datasets.formats.images import image_size
from semidense.datasets.pairs.lists import LISTS, read_list
from semidense.datasets.pairs.maps import with_map
from semidense.datasets.pairs.options import PATTERN, PairOptions, parse
from semidense.datasets.pairs.pairing import Pair, find_pairs, image_files, pair_name
from semidense.datasets.scene import DisparityRange, RangeEnd, SceneSource


def list_scenes(argument: str) -> tuple[SceneSource, ...]:
    """List the pairs that the text after the colon names.

    Raises:
        DatasetError: If it cannot be understood, or a file is missing or not valid.
    """
    sides, options = parse(argument)
    pairs = _listed(sides, options)
    for key, file in (("costs", options.costs), ("disparity", options.disparity)):
        if file and len(pairs) > 1:
            raise DatasetError(f"{key}={file}: it belongs to one pair, but there are {len(pairs)}; name one")
    wanted = {_calibration_of(pair, options) for pair in pairs}
    known = {each: read_cameras(each[0], options.unit, each[1]) for each in wanted if each[0]}
    one_view = _is_one_view(sides, options)
    return tuple(_source(pair, options, known.get(_calibration_of(pair, options)), one_view) for pair in pairs)


def _is_one_view(sides: list[str], options: PairOptions) -> bool:
    """Return whether a left view alone was given, with its disparity map."""
    is_list = Path(sides[0]).suffix.lower() in LISTS
    return options.disparity is not None and len(sides) == 1 and not options.split and not is_list


def _listed(sides: list[str], options: PairOptions) -> list[Pair]:
    if options.split:
        if len(sides) != 1:
            raise DatasetError(f"split={options.split}: one picture holds both views, so give one path, not two")
        return [Pair(pair_name(path), path, path) for path in image_files(sides[0])]
    if len(sides) == 2:
        return find_pairs(*sides)
    path = user_path(sides[0])
    if _is_one_view(sides, options):
        return [Pair(pair_name(each), each, each) for each in image_files(sides[0])]
    if path.suffix.lower() not in LISTS:
        raise DatasetError(
            f"{path}: the right view is missing; one file alone must hold both views (split=, --split) or be a list of "
            f"pairs ({', '.join(LISTS)}); write {PATTERN}"
        )
    return read_list(path)


def _calibration_of(pair: Pair, options: PairOptions) -> tuple[tuple[Path, ...], str]:
    """Return the calibration's files, and the folder that may tell which of its cameras they are."""
    files = tuple(map(user_path, options.calib)) or pair.calib
    return files, str(pair.left.absolute().parent)


def _source(pair: Pair, options: PairOptions, known: PairCalibration | None, one_view: bool) -> SceneSource:
    files = {"left": pair.left} if one_view else {"left": pair.left, "right": pair.right}
    size = _view_size(pair, options)
    if options.costs:
        files["costs"] = user_path(options.costs)
        options = _with_range_of_costs(files["costs"], options, size)
    about = described(pair.name, size, options, known)
    source = SceneSource(**about, files=files, one_view=one_view)
    source = replace(source, warnings=(*pair.warnings, *source.warnings))
    if not options.disparity:
        return source
    return with_map(source, user_path(options.disparity), options.scale, options.none)


def _with_range_of_costs(path: Path, options: PairOptions, size: tuple[int, int]) -> PairOptions:
    """Return the options with the range that a cost volume covers.

    Raises:
        DatasetError: If the volume is of views of another size, or the range that was given is another.
    """
    header = costs_header(path)
    rows, columns, count = header.shape
    if (rows, columns) != size:
        raise DatasetError(
            f"{path}: {rows} x {columns} pixels with {count} disparities, but the left view has {size[0]} x {size[1]}; "
            "a cost volume has dims y, x, d"
        )
    first = header.first if header.first is not None else options.d_min or 0
    for key, given, told in (("d_min", options.d_min, first), ("d_max", options.d_max, first + count - 1)):
        if given not in (None, told):
            raise DatasetError(
                f"{path}: {count} disparities from {first} px on, but {key}={given} was given; leave it out"
            )
    return replace(options, d_min=first, d_max=first + count - 1)


def _view_size(pair: Pair, options: PairOptions) -> tuple[int, int]:
    """Return rows and columns of a view, from the images' headers."""
    size = image_size(pair.left)
    if options.split:
        return _half(pair.left, size, options.split)
    other = image_size(pair.right)
    if other != size:
        raise DatasetError(
            f"{pair.right}: {other[0]} x {other[1]} pixels, but {pair.left} has {size[0]} x {size[1]}; both must agree"
        )
    return size


def _half(path: Path, size: tuple[int, int], split: str) -> tuple[int, int]:
    axis, what = (1, "columns") if split == "side-by-side" else (0, "rows")
    if size[axis] % 2:
        raise DatasetError(f"{path}: {size[axis]} {what} cannot be halved; split={split} needs two views of one size")
    rows, columns = size
    return (rows, columns // 2) if axis else (rows // 2, columns)


def described(name: str, size: tuple[int, int], options: PairOptions, known: PairCalibration | None) -> dict[str, Any]:
    """Return what a scene's source says beside its files: the keyword arguments of `SceneSource`.

    Args:
        name: The scene's name.
        size: Rows and columns.
        options: What the user gave.
        known: What a calibration tells.

    Raises:
        CalibrationError: If the calibration is of images of another shape.
        DatasetError: If the range is empty or wider than the image.
    """
    known = known and known.fitted(name, size)
    disparities, open_ends = _range(name, size[1], options, known)
    return {
        "name": name,
        "dataset": "pair",
        "split": "test",
        "size": size,
        "disparities": disparities,
        "reader": "semidense.datasets.pairs.images",
        "parameters": {"split": options.split} if options.split else {},
        "calibration": known.calibration if known else None,
        "open_ends": open_ends,
        "warnings": known.warnings if known else (),
    }


def _range(
    name: str, width: int, options: PairOptions, known: PairCalibration | None
) -> tuple[DisparityRange, tuple[RangeEnd, ...]]:
    """Return the range to search, and which of its ends only the image's width bounds."""
    # ETH3D's ``ndisp`` is the image's width: it bounds nothing.
    told = known.ndisp if known and known.ndisp and known.ndisp < width else None
    low, high = options.d_min, options.d_max
    if high is None and told:
        high = told - 1
    for key, value in (("d_min", low), ("d_max", high)):
        if value is not None and abs(value) >= width:
            raise DatasetError(
                f"{name}: {key}={value}, but the image is only {width} px wide: its disparities lie between "
                f"{1 - width} and {width - 1} px"
            )
    open_ends: list[RangeEnd] = []
    open_ends += ["minimum"] if low is None else []
    open_ends += ["maximum"] if high is None else []
    return DisparityRange(1 - width if low is None else low, width - 1 if high is None else high), tuple(open_ends)
