"""Take arrays in memory as a data set of one scene: both views, or the left one with a disparity map."""

import hashlib
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.datasets.arrays import DisparityMap, ImageArray, array_text, as_array
from semidense.datasets.errors import DatasetError
from semidense.datasets.formats.calibration.reading import read_cameras
from semidense.datasets.pairs.images import harmonised
from semidense.datasets.pairs.map_files import Reading, disparities, require_map
from semidense.datasets.pairs.maps import read_once
from semidense.datasets.pairs.options import PairOptions
from semidense.datasets.pairs.pair import described
from semidense.datasets.registry import Dataset
from semidense.datasets.scene import IMAGE_ROLES, DisparityRange, Scene, SceneSource


@dataclass(frozen=True)
class ArrayPair(SceneSource):
    """A scene whose views are arrays in memory.

    Attributes:
        views: The left and the right view, as `array_pair` made them.
        given: The disparity map of another matcher, (y, x) as it was given; None without one.
    """

    views: tuple[ImageArray, ...] = field(default=(), compare=False, repr=False)
    given: NDArray[Any] | None = field(default=None, compare=False, repr=False)

    def has(self, role: str) -> bool:
        """Tell whether a disparity map came with the scene."""
        return role == "disparity" and self.given is not None

    def load_map(self) -> DisparityMap:
        """Return what the disparity map means."""
        if self.given is None:
            raise DatasetError(f"{self.name}: no disparity map was given")
        return disparities("the disparity map", self.given, Reading(**self.map_reading))

    def load_images(self) -> tuple[ImageArray, ImageArray]:
        """Return both views."""
        return harmonised(self.views[0], self.views[1])

    def identity(self, roles: Collection[str] | None = None) -> dict[str, Any]:
        """Name the content of the arrays."""
        chosen = [
            *zip(IMAGE_ROLES, self.views, strict=True),
            *([("disparity", self.given)] if self.given is not None else []),
        ]
        digests = {role: _digest(view) for role, view in chosen if roles is None or role in roles}
        return {"reader": self.reader, "files": digests, "parameters": {}}


def array_pair(
    left: object, right: object | None, options: PairOptions, name: str = "pair", disparity: object | None = None
) -> Dataset:
    """Make a data set of one pair of arrays.

    Args:
        left: (y, x) or (y, x, 3) RGB, or with a last axis of 1 or of 4 (RGB and alpha, which is dropped). Whole numbers
            from 0 to 65535 in any integer dtype and byte order; see `harmonised` for their range.
        right: The right view, of the same height and width; None, if there is a disparity map, for none.
        options: What is known beside them.
        name: The scene's name.
        disparity: (y, x) of any numbers: the left view's map by another matcher, read as ``options`` say. It may be
            masked: a masked pixel has no disparity.

    Raises:
        DatasetError: If an array is no image, or has masked pixels, or the two differ in size.
    """
    one_view = right is None and disparity is not None
    first = _as_image("left image", left)
    views = (first, np.zeros_like(first) if one_view else _as_image("right image", right))
    Scene(name, *harmonised(*views), None, DisparityRange(0, 0))
    calib = tuple(Path(file) for file in options.calib)
    known = read_cameras(calib, options.unit) if calib else None
    size = (int(views[0].shape[0]), int(views[0].shape[1]))
    pair = ArrayPair(**described(name, size, options, known), files={}, views=views, one_view=one_view)
    if disparity is None:
        return Dataset("pair", (pair,))
    given = require_map("the disparity map", as_array("the disparity map", disparity))
    return Dataset(
        "pair", (replace(read_once(pair, "the disparity map", given, options.scale, options.none), given=given),)
    )


def _as_image(what: str, given: object) -> ImageArray:
    array = as_array(what, given)
    if np.ma.is_masked(array):
        raise DatasetError(f"{what} has masked pixels, and an image has a value everywhere: give array.filled(0)")
    array = np.asarray(array)
    bands = array.shape[2:]
    if bands in ((1,), (4,)):
        array = array[..., 0] if bands == (1,) else array[..., :3]
    if array.dtype.kind not in "ui" or array.shape[2:] not in ((), (3,)) or array.ndim < 2:
        raise DatasetError(
            f"{what} is {array_text(array)}; give uint8 or uint16, (rows, columns) or (rows, columns, 3)"
            f"{_about_floats(array)}"
        )
    return _in_16_bits(what, np.ascontiguousarray(array))


def _about_floats(array: NDArray[Any]) -> str:
    if array.dtype.kind != "f" or array.size == 0:
        return ""
    known = array[np.isfinite(array)]
    if not known.size:
        return "; all values are NaN or infinite: was it filled?"
    others = f"{array.size - known.size} values are NaN or infinite: replace them; " if known.size < array.size else ""
    return (
        f"; {others}the values are {known.min():g} to {known.max():g}: scale both views alike, such as "
        "(view * 65535).astype(numpy.uint16) for 0 to 1"
    )


def _in_16_bits(what: str, array: NDArray[Any]) -> ImageArray:
    """Return integers of any kind as uint8 or uint16 in this machine's byte order, with their values, as a copy."""
    if array.dtype == np.uint8:
        eight: ImageArray = array.astype(np.uint8)
        return eight
    low, high = (int(array.min()), int(array.max())) if array.size else (0, 0)
    if low < 0 or high > np.iinfo(np.uint16).max:
        raise DatasetError(f"{what}: values from {low} to {high} do not fit 16 bits; scale both views alike first")
    return array.astype(np.uint16)


def _digest(view: NDArray[Any]) -> str:
    header = f"{view.dtype.str} {view.shape} ".encode()
    mask = np.ma.getmaskarray(view).tobytes() if np.ma.is_masked(view) else b""
    return hashlib.sha256(header + np.ascontiguousarray(view).tobytes() + mask).hexdigest()
