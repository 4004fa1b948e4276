"""Aggregation of a whole volume, a strip of rows at a time, so that neither the volume nor its sums are held whole.

A pass down the image keeps the front at the top of each strip. Then each strip, from the last to the first, follows
its downward paths once more from that front and its upward paths from the strip below. Every sum is of whole numbers:
the result is the same, bit for bit, however the image is cut.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from semidense.stages.disparity.aggregation.levels import Levels, levels_of
from semidense.stages.disparity.aggregation.paths import Front, follow, steps_down
from semidense.stages.disparity.declaration import AggregatedParams
from semidense.stages.stage import StageError

CELLS = 1 << 26
"""Most cells of a strip: 128 MB for its levels and as much for their sums."""
CHUNK = 32
"""Strips begin at multiples of so many rows, the rows of a chunk of the stored volume."""


class Volume(Protocol):
    """A cost volume (y, x, d) that gives some of its rows as a NumPy array: an array itself, or one of zarr."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Rows, columns and disparities."""

    def __getitem__(self, rows: slice, /) -> Any:  # noqa: ANN401 - whatever NumPy takes for an array
        """Return the costs of some rows."""


@dataclass(frozen=True)
class Strip:
    """Some rows of an aggregated volume.

    Attributes:
        rows: which rows of the image.
        single: their costs before aggregation.
        aggregated: (y, x, d) uint16: the sum of the costs of all paths, levels.
    """

    rows: slice
    single: Levels
    aggregated: NDArray[np.uint16]


def aggregate(
    volume: Volume, gray: NDArray[np.uint8], d_min: int, params: AggregatedParams, rows: int | None = None
) -> Iterator[Strip]:
    """Yield the aggregated volume in strips, the last rows first.

    Args:
        volume: (y, x, d) float16 or float32 costs, lower is better; NaN is a cell without a cost. It is read twice, a
            strip at a time; once, if it is one strip.
        gray: (y, x) uint8 of the same view: penalties are smaller across its edges.
        d_min: the disparity of index 0, px.
        params: paths and penalties.
        rows: rows of a strip; None: as many as ``CELLS`` allows.

    Raises:
        StageError: if the shapes do not fit together.
    """
    if len(volume.shape) != 3 or gray.shape != volume.shape[:2]:
        raise StageError(f"the cost volume has shape {volume.shape}, the view {gray.shape}: y and x must agree")
    height, width, depth = volume.shape
    strips = cut(height, rows or strip_rows(width, depth))
    begin = Front.beginning(steps_down(params), width, depth)
    fronts = [begin]
    for strip in strips[:-1]:
        levels = levels_of(volume[strip], d_min)
        ignored = np.empty(levels.above.shape, np.int16)
        fronts.append(follow(levels, gray, strip.start, params, fronts[-1], ignored, upwards=False))
    below = begin
    for strip in reversed(strips):
        levels = levels_of(volume[strip], d_min)
        sums = np.zeros(levels.above.shape, np.int16)
        follow(levels, gray, strip.start, params, fronts.pop(), sums, upwards=False)
        below = follow(levels, gray, strip.start, params, below, sums, upwards=True)
        yield Strip(strip, levels, sums.view(np.uint16))


def strip_rows(width: int, depth: int) -> int:
    """Return the rows of a strip: whole chunks, of at most ``CELLS`` cells if that is a chunk at least.

    >>> strip_rows(741, 70), strip_rows(3000, 281)
    (1280, 64)
    """
    return max(1, CELLS // (width * depth * CHUNK)) * CHUNK


def cut(height: int, rows: int) -> list[slice]:
    """Return the strips of an image, from top to bottom.

    >>> cut(5, 2)
    [slice(0, 2, None), slice(2, 4, None), slice(4, 5, None)]
    """
    return [slice(*ends) for ends in pairwise([*range(0, height, rows), height])]
