"""Take a pair of arrays in memory as a data set of one scene."""

import hashlib
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from semidense.datasets.arrays import ImageArray
from semidense.datasets.errors import DatasetError
from semidense.datasets.formats.cameras import read_cameras
from semidense.datasets.pairs.images import harmonised
from semidense.datasets.pairs.pair import PairOptions, described
from semidense.datasets.registry import Dataset
from semidense.datasets.scene import IMAGE_ROLES, DisparityRange, Scene, SceneSource


@dataclass(frozen=True)
class ArrayPair(SceneSource):
    """A scene whose views are arrays in memory.

    Attributes:
        views: The left and the right view, as `array_pair` made them.
    """

    views: tuple[ImageArray, ...] = field(default=(), compare=False, repr=False)

    def load_images(self) -> tuple[ImageArray, ImageArray]:
        """Return both views."""
        return harmonised(self.views[0], self.views[1])

    def identity(self, roles: Collection[str] | None = None) -> dict[str, Any]:
        """Name the content of the arrays."""
        chosen = [(role, view) for role, view in zip(IMAGE_ROLES, self.views, strict=True)]
        digests = {role: _digest(view) for role, view in chosen if roles is None or role in roles}
        return {"reader": self.reader, "files": digests, "parameters": {}}


def array_pair(left: object, right: object, options: PairOptions, name: str = "pair") -> Dataset:
    """Make a data set of one pair of arrays.

    Args:
        left: (y, x) or (y, x, 3) RGB, or with a last axis of 1 or of 4 (alpha, which is dropped); uint8 or uint16.
        right: The right view, of the same height and width.
        options: What is known beside them.
        name: The scene's name.

    Raises:
        DatasetError: If an array is no image, or the two differ in size.
    """
    views = (_as_image("left image", left), _as_image("right image", right))
    Scene(name, *harmonised(*views), None, DisparityRange(0, 0))
    calib = tuple(Path(file) for file in options.calib)
    known = read_cameras(calib, options.unit) if calib else None
    size = (int(views[0].shape[0]), int(views[0].shape[1]))
    return Dataset("pair", (ArrayPair(**described(name, size, options, known), files={}, views=views),))


def _as_image(what: str, given: object) -> ImageArray:
    array = np.asarray(given)
    bands = array.shape[2:]
    if bands in ((1,), (4,)):
        array = array[..., 0] if bands == (1,) else array[..., :3]
    if array.dtype not in (np.uint8, np.uint16) or array.shape[2:] not in ((), (3,)) or array.ndim < 2:
        shape = " x ".join(map(str, array.shape)) or "a scalar"
        raise DatasetError(
            f"{what} is {array.dtype}, {shape}; give uint8 or uint16, (rows, columns) or (rows, columns, 3)"
        )
    return np.ascontiguousarray(array)


def _digest(view: ImageArray) -> str:
    header = f"{view.dtype.str} {view.shape} ".encode()
    return hashlib.sha256(header + np.ascontiguousarray(view).tobytes()).hexdigest()
