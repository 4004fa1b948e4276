"""Read a scene of Middlebury's 2001, 2003, 2005 or 2006 sets: two images and disparities scaled to 8-bit gray.

The gray value is the disparity times a scale, 0 means unknown. No file says the scale: for 2001 and 2003 the scene's
name tells it (8; Tsukuba 16; Cones and Teddy 4), for 2005 and 2006 the name of a folder above (ThirdSize 3, HalfSize 2,
FullSize 1). In 2001 and at third size the truth comes in steps of 1/8 and 1/3 px.

Disparities to search: nothing is published, so 0 to the left truth's largest, rounded up; without a truth 0 to 255
divided by the scale, the largest that the format holds. Mask: the published ``nonocc.png``, else a left-right check of
the two truths, else the warped truth's.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semidense.datasets.arrays import DisparityMap, ImageArray
from semidense.datasets.benchmarks.folders import contents
from semidense.datasets.errors import DatasetError, ImageError, LayoutError
from semidense.datasets.formats.images import image_size, read_stored
from semidense.datasets.readers import assemble_truth, read_pair
from semidense.datasets.scene import DisparityRange, Parameter, SceneSource, Truth

_LIGHTINGS = "Illum1"
_SUFFIXES = (".png", ".ppm", ".pgm")
_SCALES_2001 = {"barn1": 8, "barn2": 8, "bull": 8, "poster": 8, "sawtooth": 8, "tsukuba": 16, "venus": 8}
_SCALES_2003 = {"cones": 4, "teddy": 4}
_SCALES_BY_SIZE = {"ThirdSize": 3, "HalfSize": 2, "FullSize": 1}
_SCENES_2005 = {"art", "books", "computer", "dolls", "drumsticks", "dwarves", "laundry", "moebius", "reindeer"}


@dataclass(frozen=True)
class _Layout:
    roles: Mapping[str, str]
    pattern: str


_BY_NUMBER = _Layout(
    {"left": "im2", "right": "im6", "truth": "disp2", "truth_right": "disp6", "mask": "nonocc"},
    "im2 im6 [disp2] [disp6] [nonocc] as .png, .ppm or .pgm",
)
_BY_VIEW = _Layout(
    {"left": "view1", "right": "view5", "truth": "disp1", "truth_right": "disp5", "mask": "nonocc"},
    "view1 view5 [disp1] [disp5] as .png, .ppm or .pgm",
)

_TSUKUBA = _Layout(
    {"left": "scene1.row3.col3", "right": "scene1.row3.col4", "truth": "truedisp.row3.col3"},
    "scene1.row3.col3 scene1.row3.col4 [truedisp.row3.col3] as .png, .ppm or .pgm",
)

PATTERNS = (_BY_NUMBER.pattern, _BY_VIEW.pattern, _TSUKUBA.pattern)
"""The files of a scene, for messages."""


def is_scene(folder: Path) -> bool:
    """Tell whether a folder follows one of these layouts, complete or not."""
    return _layout(folder) is not None


def source(folder: Path, name: str, views: Mapping[str, Path]) -> SceneSource:
    """Describe the scene in a folder; reads the left truth once, for its largest disparity.

    Args:
        folder: The scene's.
        name: Its name.
        views: Other pictures of the roles ``left`` and ``right``: of another lighting or exposure.

    Raises:
        LayoutError: If a view is missing, or nothing tells the scale.
        DatasetError: If the left image's header or the left truth is not valid.
    """
    layout = _layout(folder)
    if layout is None:
        raise LayoutError(f"{folder}: expected {' or '.join(PATTERNS)}, found {contents(folder)}")
    files = _files(folder, layout, views)
    year, scale = _year_and_scale(folder, layout)
    return SceneSource(
        name=name,
        dataset=f"middlebury/{year}",
        split="train",
        size=image_size(files["left"]),
        disparities=_disparities(files, scale),
        reader=__name__,
        files=files,
        parameters={"scale": scale},
        has_truth="truth" in files,
    )


def read_images(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> tuple[ImageArray, ImageArray]:
    """Read the left and the right view; raises `DatasetError` if one cannot be read."""
    return read_pair(files)


def read_truth(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> Truth:
    """Read the truths and the mask; ``parameters["scale"]`` is gray levels a pixel of disparity.

    Raises:
        DatasetError: If a file cannot be read, or is not 8-bit gray.
    """
    scale = parameters["scale"]
    if not isinstance(scale, int) or scale < 1:
        raise DatasetError(f"{files['truth']}: the scale is {scale!r}; it must be a whole number above 0")
    right = _read_scaled(files["truth_right"], scale) if "truth_right" in files else None
    return assemble_truth(_read_scaled(files["truth"], scale), right, files.get("mask"))


def _layout(folder: Path) -> _Layout | None:
    for layout in (_BY_NUMBER, _BY_VIEW, _TSUKUBA):
        if _find(folder, layout.roles["left"]) or _find(folder, layout.roles["right"]):
            return layout
    return _BY_VIEW if (folder / _LIGHTINGS).is_dir() else None


def _find(folder: Path, stem: str) -> Path | None:
    candidates = (folder / f"{stem}{suffix}" for suffix in _SUFFIXES)
    return next((path for path in candidates if path.is_file()), None)


def _files(folder: Path, layout: _Layout, views: Mapping[str, Path]) -> dict[str, Path]:
    found = {role: path for role, stem in layout.roles.items() if (path := _find(folder, stem))} | dict(views)
    missing = [layout.roles[role] for role in ("left", "right") if role not in found]
    if missing and (folder / _LIGHTINGS).is_dir():
        raise LayoutError(
            f"{folder}: no {missing[0]}, but pictures of several lightings and exposures; add to the folder "
            "which to take, such as ,left=Illum1.Exp1,right=Illum1.Exp1"
        )
    if missing:
        raise LayoutError(f"{folder}: no {missing[0]}; expected {layout.pattern}, found {contents(folder)}")
    return found


def _year_and_scale(folder: Path, layout: _Layout) -> tuple[str, int]:
    path = folder.resolve()
    scene = path.name.lower()
    if layout is _BY_VIEW:
        year = "2005" if scene in _SCENES_2005 else "2006"
        sizes = [_SCALES_BY_SIZE[part] for part in reversed(path.parts) if part in _SCALES_BY_SIZE]
        if sizes:
            return year, sizes[0]
        raise LayoutError(
            f"{folder}: no folder above is named {' or '.join(_SCALES_BY_SIZE)}; keep one to tell the scale"
        )
    for year, scales in (("2001", _SCALES_2001), ("2003", _SCALES_2003)):
        if scene in scales:
            return year, scales[scene]
    known = ", ".join([*_SCALES_2001, *_SCALES_2003])
    raise LayoutError(f"{folder}: the scale of {scene!r} is not known; keep the published folder name, one of {known}")


def _disparities(files: Mapping[str, Path], scale: int) -> DisparityRange:
    if "truth" not in files:
        return DisparityRange(0, 255 // scale)
    disparity = _read_scaled(files["truth"], scale)
    if np.isnan(disparity).all():
        raise ImageError(f"{files['truth']}: no known disparity in it; all pixels are 0")
    return DisparityRange(0, math.ceil(np.nanmax(disparity)))


def _read_scaled(path: Path, scale: int) -> DisparityMap:
    stored = read_stored(path)
    if stored.dtype != np.uint8 or stored.ndim != 2:
        raise ImageError(f"{path}: {stored.dtype} of {stored.shape}; a scaled disparity map is 8-bit gray")
    disparity: DisparityMap = stored.astype(np.float32) / np.float32(scale)
    disparity[stored == 0] = np.nan
    return disparity
