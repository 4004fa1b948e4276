"""Read the costs of a pixel and the patches that the two networks see, from the few chunks around it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.pipeline.figures.cost_volume import local_minima
from semidense.stages.evaluation.declaration import RADIUS as EVALUATION_RADIUS
from semidense.stages.matching.declaration import RADIUS as MATCHING_RADIUS
from semidense.stages.transforms.gray import to_gray

Arrays = Any
"""zarr's arrays, or NumPy's: what can be sliced."""


@dataclass(frozen=True, eq=False)
class CostCurve:
    """The costs of a pixel.

    Attributes:
        disparities: (d,) px.
        costs: (d,) float32, log-odds of a mismatch; NaN where there is no right pixel.
        winner: index of the least cost; None if there is none.
        runner_up: index of the next local minimum; None if there is none.
    """

    disparities: NDArray[np.int_]
    costs: NDArray[np.float32]
    winner: int | None
    runner_up: int | None

    @classmethod
    def read(cls, costs: Arrays, disparities: NDArray[Any], y: int, x: int) -> "CostCurve":
        """Read the curve of a pixel from a volume (y, x, d)."""
        curve = np.asarray(costs[y, x, :]).astype(np.float32)
        lowest = [*local_minima(curve), None, None]
        known = np.isfinite(curve[lowest[0]]) if lowest[0] is not None else False
        return cls(disparities.astype(int), curve, lowest[0] if known else None, lowest[1] if known else None)


def window(array: Arrays, y: int, x: int, radius: int) -> NDArray[Any]:
    """Return the square around a pixel of an array (..., y, x), continued beyond the image by its edge.

    The centre may lie outside of the image: then all of the square is its edge.

    >>> window(np.arange(12).reshape(3, 4), 0, 3, 1).tolist()
    [[2, 3, 3], [2, 3, 3], [6, 7, 7]]
    """
    height, width = array.shape[-2:]
    rows = np.clip(np.arange(y - radius, y + radius + 1), 0, height - 1)
    columns = np.clip(np.arange(x - radius, x + radius + 1), 0, width - 1)
    part = np.asarray(array[..., rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1])
    return part[..., rows - rows[0], :][..., columns - columns[0]]


def matching_patches(channels: Arrays, y: int, x: int, disparity: float) -> NDArray[np.float32]:
    """Return the left patch of a pixel and the right one at a disparity, in all channels: (view, channel, 11, 11).

    The channels are continued by their edge, as the matching-Net sees them.
    """
    left = window(_View(channels, 0), y, x, MATCHING_RADIUS)
    right = window(_View(channels, 1), y, x - round(disparity), MATCHING_RADIUS)
    return np.stack([left, right]).astype(np.float32)


def evaluation_patch(left: Arrays, disparity: Arrays, y: int, x: int) -> tuple[NDArray[Any], NDArray[np.float32]]:
    """Return the 101 x 101 patches of gray levels and raw disparity that the evaluation-Net scores a pixel by.

    Args:
        left: (y, x, band), the left view.
        disparity: (y, x), px.
        y: row of the pixel.
        x: its column.
    """
    gray = to_gray(np.ascontiguousarray(np.moveaxis(window(_BandsFirst(left), y, x, EVALUATION_RADIUS), 0, -1)))
    return gray, window(disparity, y, x, EVALUATION_RADIUS).astype(np.float32)


class _View:
    """One view of the channels (view, channel, y, x), unread."""

    def __init__(self, channels: Arrays, view: int) -> None:
        self.channels, self.view, self.shape = channels, view, channels.shape[1:]

    def __getitem__(self, place: tuple[Any, ...]) -> NDArray[Any]:
        return np.asarray(self.channels[(self.view, slice(None), *place[1:])])


class _BandsFirst:
    """A view (y, x, band) as (band, y, x), unread."""

    def __init__(self, view: Arrays) -> None:
        self.view, self.shape = view, (view.shape[2], *view.shape[:2])

    def __getitem__(self, place: tuple[Any, ...]) -> NDArray[Any]:
        return np.moveaxis(np.asarray(self.view[place[1:]]), -1, 0)
