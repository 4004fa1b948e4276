"""Read a data set of one's own, described in a small TOML file instead of code: ``toml:FILE.toml``.

::

    left = "left/*.png"            what * stands for names the scene, and pairs the files
    right = "right/*.png"
    truth = "disparity/*.pfm"      optional: PFM, or an 8- or 16-bit gray image whose 0 means unknown
    truth_right = "disp1/*.pfm"    optional
    mask = "visible/*.png"         optional: 255 where a pixel is visible in both views
    calib = "calib.txt"            optional: one file for all, or a pattern
    scale = 256                    stored value of 1 px; 1 by default for PFM, needed for an image
    split = "train"                or "test", the default: whether it may be trained on
    d_min = 0                      the range to search; without it that of the scene's truth, else an estimate
    d_max = 191
    unit = "m"                     of a calibration that does not tell it

Patterns are relative to the file and hold one ``*``, in a file's or a folder's name. The name of the data set is that
of the file. A scene may lack what is optional, if another scene has it; it never lacks a view.
"""

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from semidense.datasets.arrays import DisparityMap, ImageArray
from semidense.datasets.errors import DatasetError, LayoutError
from semidense.datasets.formats.calibration.reading import read_cameras
from semidense.datasets.formats.files import read_bytes, user_path
from semidense.datasets.formats.images import image_size, read_stored
from semidense.datasets.formats.pfm import read_pfm
from semidense.datasets.pairs import images
from semidense.datasets.pairs.names import composed
from semidense.datasets.pairs.options import PairOptions
from semidense.datasets.pairs.pair import described
from semidense.datasets.readers import assemble_truth
from semidense.datasets.scene import DisparityRange, Parameter, SceneSource, Truth

_ROLES = ("left", "right", "truth", "truth_right", "mask", "calib")
_ENTRIES: dict[str, tuple[type, ...]] = {
    **dict.fromkeys((*_ROLES, "split", "unit"), (str,)),
    **dict.fromkeys(("d_min", "d_max"), (int,)),
    "scale": (int, float),
}
_NEEDS = {"truth_right": "truth", "mask": "truth", "scale": "truth", "unit": "calib"}
"""What an entry says something of."""
_LARGEST_FILE = 1 << 16
_SCALES = (1e-6, 1e9)
"""Smallest and largest stored value of 1 px, but for its sign."""


def list_scenes(argument: str) -> tuple[SceneSource, ...]:
    """List the scenes of a description, in the order of their names.

    Raises:
        LayoutError: If a pattern finds nothing of any scene, or a left view has no right one.
        DatasetError: If the description, or a file that must be looked into, is not valid.
    """
    path = user_path(argument)
    entries = _entries(path)
    found = {role: _matches(path, role, entries[role]) for role in _ROLES if role in entries}
    missing = sorted(found["left"].keys() - found["right"].keys())
    if not found["left"] or missing:
        what = f"no right view for {found['left'][missing[0]]}" if missing else "no left view"
        raise LayoutError(f"{path}: {what}; left = {entries['left']!r}, right = {entries['right']!r}")
    names = sorted(found["left"])
    for role, paths in found.items():
        if not paths.keys() & {*names, ""}:
            there = f"finds no scene but {min(paths)}, and the first one is {names[0]}" if paths else "finds nothing"
            raise LayoutError(f"{path}: {role} = {entries[role]!r} {there}; correct the pattern, or leave it out")
    return tuple(_source(path, entries, name or found["left"][name].stem, _files(found, name)) for name in names)


def read_images(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> tuple[ImageArray, ImageArray]:
    """Read both views, alike in depth and bands; raises `DatasetError` if one cannot be read."""
    return images.read_images(files, {})


def read_truth(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> Truth:
    """Read the truths and the mask; ``parameters["scale"]`` is the stored value of 1 px.

    Raises:
        DatasetError: If a file cannot be read, or is no map.
    """
    scale = float(parameters["scale"] or 1)
    right = _read_map(files["truth_right"], scale) if "truth_right" in files else None
    return assemble_truth(_read_map(files["truth"], scale), right, files.get("mask"))


def _entries(path: Path) -> dict[str, Any]:
    try:
        entries = tomllib.loads(read_bytes(path, _LARGEST_FILE, DatasetError, "description").decode("utf-8-sig"))
    except ValueError as error:  # of a number with too many digits, a plain one
        if isinstance(error, DatasetError):
            raise
        raise DatasetError(f"{path}: no valid TOML ({error})") from error
    for name, value in entries.items():
        if name not in _ENTRIES:
            raise DatasetError(f"{path}: {name} is not known; known are {', '.join(_ENTRIES)}")
        if not isinstance(value, _ENTRIES[name]) or isinstance(value, bool):
            expected = {str: "text", int: "a whole number"}.get(_ENTRIES[name][-1], "a number")
            raise DatasetError(f"{path}: {name} = {value!r}; expected {expected}")
    _check(path, entries)
    return entries


def _check(path: Path, entries: Mapping[str, Any]) -> None:
    for role in ("left", "right"):
        if role not in entries:
            raise DatasetError(f'{path}: no {role}; write a pattern such as {role} = "{role}/*.png"')
    for role in _ROLES:
        pattern = PurePath(entries.get(role, role))
        if not pattern.name or pattern.anchor:
            raise DatasetError(
                f"{path}: {role} = {entries[role]!r}; give a pattern that is relative to the folder of this file"
            )
    if entries.get("split", "test") not in ("train", "test"):
        raise DatasetError(f"{path}: split = {entries['split']!r}; give train or test")
    if not _SCALES[0] <= abs(entries.get("scale", 1)) <= _SCALES[1]:
        raise DatasetError(f"{path}: scale = {entries['scale']:.6g}; give the stored value of 1 px, such as 256")
    for role in ("truth", "truth_right"):
        if "scale" not in entries and not entries.get(role, ".pfm").lower().endswith(".pfm"):
            raise DatasetError(f"{path}: no scale; {role} is an image, so give the stored value of 1 px")
    for name, other in _NEEDS.items():
        if name in entries and other not in entries:
            raise DatasetError(f"{path}: {name} = {entries[name]!r}, but no {other}; give both, or leave {name} out")


def _matches(path: Path, role: str, pattern: str) -> dict[str, Path]:
    """Return the files that a pattern fits, by what its ``*`` stands for; without ``*`` one file, for all scenes."""
    if pattern.count("*") > 1 or set(pattern) & set("[]?"):
        raise LayoutError(f"{path}: {role} = {pattern!r}; give one *, which names the scene, and no [, ] or ?")
    pattern = PurePath(pattern).as_posix()  # without the ./ that a match will not have
    fits = re.compile(re.escape(composed(pattern)).replace(r"\*", "([^/]*)"))
    found = {}
    for file in sorted(path.parent.glob(pattern)):
        match = fits.fullmatch(composed(file.relative_to(path.parent).as_posix()))
        if match and file.is_file() and not file.name.startswith("."):
            found["".join(match.groups())] = file
    return found


def _files(found: Mapping[str, Mapping[str, Path]], name: str) -> dict[str, Path]:
    """Return a scene's file of each role; one that has no ``*`` in its pattern belongs to every scene."""
    each = {role: paths.get(name, paths.get("")) for role, paths in found.items()}
    return {role: path for role, path in each.items() if path is not None}


def _source(path: Path, entries: Mapping[str, Any], name: str, files: dict[str, Path]) -> SceneSource:
    calib = files.pop("calib", None)
    known = read_cameras([calib], entries.get("unit"), str(files["left"].absolute().parent)) if calib else None
    size = image_size(files["left"])
    options = PairOptions(d_min=entries.get("d_min"), d_max=entries.get("d_max"))
    try:
        about = described(name, size, options, known)
    except DatasetError as error:
        raise type(error)(f"{path}: {error}") from error
    source = replace(
        SceneSource(**about, files=files),
        dataset=path.stem,
        split=entries.get("split", "test"),
        reader=__name__,
        parameters={"scale": entries.get("scale", 1)},
        has_truth="truth" in files,
    )
    return _closed(source) if source.open_ends and source.has_truth else source


def _closed(source: SceneSource) -> SceneSource:
    """Return the scene with the ends of its range that nobody gave from its truth."""
    truth = _read_map(source.files["truth"], float(source.parameters["scale"] or 1))
    if np.isnan(truth).all():
        raise DatasetError(f"{source.files['truth']}: no known disparity in it; give d_min and d_max")
    if (farthest := float(np.nanmax(np.abs(truth)))) >= source.size[1]:
        raise DatasetError(
            f"{source.files['truth']}: a disparity of {farthest:.6g} px in an image of {source.size[1]} px; give the "
            "scale, the stored value of 1 px"
        )
    low, high = source.disparities.minimum, source.disparities.maximum
    low = min(0, math.floor(np.nanmin(truth))) if "minimum" in source.open_ends else low
    high = math.ceil(np.nanmax(truth)) if "maximum" in source.open_ends else high
    return replace(source, disparities=DisparityRange(low, high), open_ends=())


def _read_map(path: Path, scale: float) -> DisparityMap:
    if path.suffix.lower() == ".pfm":
        return (read_pfm(path) / np.float32(scale)).astype(np.float32)
    stored = read_stored(path)
    if stored.ndim != 2:
        raise DatasetError(f"{path}: a colour image; a map of disparities is gray")
    return np.where(stored > 0, stored / np.float32(scale), np.float32(np.nan)).astype(np.float32)
