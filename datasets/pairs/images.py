"""Read the two views of a user's own pair, and bring them to the same depth, range and number of bands."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semidense.datasets.arrays import ImageArray
from semidense.datasets.formats import costs
from semidense.datasets.formats.images import read_image
from semidense.datasets.readers import read_pair
from semidense.datasets.scene import Parameter

_FULL = 65535
_EIGHT_BITS = 8


def read_images(files: Mapping[str, Path], parameters: Mapping[str, Parameter]) -> tuple[ImageArray, ImageArray]:
    """Read both views, alike in depth and bands; raises `DatasetError` if one cannot be read.

    With ``parameters["split"]`` the file of the role ``left`` holds both views. Without a right view zeros stand in its
    place.
    """
    if split := parameters.get("split"):
        whole = read_image(files["left"])
        rows, columns = whole.shape[0] // 2, whole.shape[1] // 2
        if split == "side-by-side":
            return harmonised(whole[:, :columns], whole[:, columns:])
        return harmonised(whole[:rows], whole[rows:])
    if "right" not in files:
        left = read_image(files["left"])
        return harmonised(left, np.zeros_like(left))
    return harmonised(*read_pair(files))


def read_costs(files: Mapping[str, Path], _: Mapping[str, Parameter]) -> NDArray[np.float16]:
    """Read the cost volume (y, x, d) that came with the pair; raises `DatasetError` if it is not valid."""
    return costs.read_costs(files["costs"])


def harmonised(left: ImageArray, right: ImageArray) -> tuple[ImageArray, ImageArray]:
    """Bring two views to the same depth, range and number of bands, without loss.

    16-bit views that use fewer bits, as those of 10- and 12-bit sensors do, are stretched to the full range: by
    ``65535 / (2^bits - 1)``, with the bits (at least 8) that the largest value of both views together needs. Of an
    8-bit and a 16-bit view, each is stretched by its own bits. Of a gray and a colour view, the first gets three equal
    bands, whose luma it is.

    >>> [view.tolist() for view in harmonised(np.array([[255]], np.uint8), np.array([[4095]], np.uint16))]
    [[[65535]], [[65535]]]
    """
    if left.dtype != right.dtype:
        left, right = _stretched(left, _bits(left)), _stretched(right, _bits(right))
    elif left.dtype == np.uint16:
        bits = max(_bits(left), _bits(right))
        left, right = _stretched(left, bits), _stretched(right, bits)
    if left.ndim != right.ndim:
        left, right = _coloured(left), _coloured(right)
    return left, right


def _bits(view: ImageArray) -> int:
    """Count the bits that a view's largest value needs; an 8-bit view has all its bits."""
    return max(_EIGHT_BITS, int(view.max(initial=0)).bit_length())


def _stretched(view: ImageArray, bits: int) -> ImageArray:
    """Return a view in 16 bits with ``2^bits - 1`` at 65535, rounded to the nearest value."""
    largest = (1 << bits) - 1
    return ((view.astype(np.uint32) * _FULL + largest // 2) // largest).astype(np.uint16)


def _coloured(view: ImageArray) -> ImageArray:
    return view if view.ndim == 3 else view[..., np.newaxis].repeat(3, axis=2)
