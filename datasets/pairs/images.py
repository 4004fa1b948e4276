"""Read the two views of a user's own pair, and bring them to the same depth and number of bands."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from semidense.datasets.arrays import ImageArray
from semidense.datasets.readers import read_pair
from semidense.datasets.scene import Parameter

_SIXTEEN_BITS = 257
"""What takes 255 to 65535."""


def read_images(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> tuple[ImageArray, ImageArray]:
    """Read both views, alike in depth and bands; raises `DatasetError` if one cannot be read."""
    return harmonised(*read_pair(files))


def harmonised(left: ImageArray, right: ImageArray) -> tuple[ImageArray, ImageArray]:
    """Bring two views to the same depth and number of bands, without loss.

    Of an 8-bit and a 16-bit view, the first is multiplied by 257 (255 becomes 65535); of a gray and a colour view, the
    first gets three equal bands, whose luma it is.

    >>> [view.tolist() for view in harmonised(np.array([[255]], np.uint8), np.array([[256]], np.uint16))]
    [[[65535]], [[256]]]
    """
    if left.dtype != right.dtype:
        left, right = _deep(left), _deep(right)
    if left.ndim != right.ndim:
        left, right = _coloured(left), _coloured(right)
    return left, right


def _deep(view: ImageArray) -> ImageArray:
    return view.astype(np.uint16) * np.uint16(_SIXTEEN_BITS if view.dtype == np.uint8 else 1)


def _coloured(view: ImageArray) -> ImageArray:
    return view if view.ndim == 3 else view[..., np.newaxis].repeat(3, axis=2)
