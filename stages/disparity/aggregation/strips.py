"""Aggregation of a whole volume, a strip of rows at a time, so that neither the volume nor its sums are held whole.

A sweep down the image keeps the front at the top of each strip. Then each strip, from the last to the first, follows
its downward paths once more from that front and its upward paths from the strip below. Costs that are summed twice take
a sweep more, since the second sums begin where the first ones end. Every sum is of whole numbers: the result is the
same, bit for bit, however the image is cut.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from semidense.stages.disparity.aggregation.levels import Levels, levels_of, with_mean
from semidense.stages.disparity.aggregation.paths import Front, follow, steps_down
from semidense.stages.disparity.declaration import AggregatedParams
from semidense.stages.stage import StageError

CELLS = 1 << 26
"""Most cells of a strip: 128 MB for its levels; two passes hold four times as much at once."""
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
        aggregated: (y, x, d) uint16: the sum of the costs of all paths, levels; of the second pass, if there are two.
        first: the same of the first pass.
    """

    rows: slice
    single: Levels
    aggregated: NDArray[np.uint16]
    first: NDArray[np.uint16]


def aggregate(
    volume: Volume, gray: NDArray[np.uint8], d_min: int, params: AggregatedParams, rows: int | None = None
) -> Iterator[Strip]:
    """Yield the aggregated volume in strips, the last rows first.

    Args:
        volume: (y, x, d) float16 or float32 costs, lower is better; NaN is a cell without a cost. It is read once a
            sweep, a strip at a time; once in all, if it is one strip.
        gray: (y, x) uint8 of the same view, smoothed: penalties are smaller across its edges.
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
    image = _Image(volume, gray, d_min, params)
    return image.summed_twice(strips) if params.passes == 2 else image.summed(strips)


@dataclass(frozen=True)
class _Image:
    """What is summed, and how; see ``aggregate``."""

    volume: Volume
    gray: NDArray[np.uint8]
    d_min: int
    params: AggregatedParams

    def summed(self, strips: Sequence[slice]) -> Iterator[Strip]:
        """Yield the sums of one pass, the last strip first."""
        fronts = [self._beginning()]
        for rows in strips[:-1]:
            fronts.append(self._follow(rows, self._levels(rows).above, fronts[-1], upwards=False))
        below = self._beginning()
        for rows in reversed(strips):
            levels = self._levels(rows)
            sums, _, below = self._sums(rows, levels.above, fronts.pop(), below)
            yield Strip(rows, levels, sums, sums)

    def summed_twice(self, strips: Sequence[slice]) -> Iterator[Strip]:
        """Yield the sums of a second pass, the last strip first."""
        below = [self._beginning()]  # the first pass below each strip, the last strip first
        for rows in reversed(strips[1:]):
            below.append(self._follow(rows, self._levels(rows).above, below[-1], upwards=True))
        above, again = [self._beginning()], [self._beginning()]  # both passes above each strip, the first strip first
        for rows, front in zip(strips[:-1], reversed(below), strict=False):
            levels = self._levels(rows)
            sums, after, _ = self._sums(rows, levels.above, above[-1], front)
            above.append(after)
            costs = with_mean(levels.above, sums, self.params.paths)
            again.append(self._follow(rows, costs, again[-1], upwards=False))
        last = self._beginning()
        for rows, front in zip(reversed(strips), below, strict=True):
            levels = self._levels(rows)
            first, _, _ = self._sums(rows, levels.above, above.pop(), front)
            costs = with_mean(levels.above, first, self.params.paths)
            sums, _, last = self._sums(rows, costs, again.pop(), last)
            del costs  # a strip is out for as long as its caller works on it
            yield Strip(rows, levels, sums, first)

    def _beginning(self) -> Front:
        return Front.beginning(steps_down(self.params), *self.volume.shape[1:])

    def _levels(self, rows: slice) -> Levels:
        return levels_of(self.volume[rows], self.d_min)

    def _follow(self, rows: slice, above: NDArray[np.int16], front: Front, *, upwards: bool) -> Front:
        """Return the front after some rows, whose sums are of no use."""
        ignored = np.empty(above.shape, np.int16)
        return follow(above, self.gray, rows.start, self.params, front, ignored, upwards=upwards)

    def _sums(
        self, rows: slice, above: NDArray[np.int16], front: Front, below: Front
    ) -> tuple[NDArray[np.uint16], Front, Front]:
        """Return the sums of some rows, from the fronts on both sides of them; and both fronts after them."""
        sums = np.zeros(above.shape, np.int16)
        down, up = (
            follow(above, self.gray, rows.start, self.params, start, sums, upwards=upwards)
            for start, upwards in ((front, False), (below, True))
        )
        return sums.view(np.uint16), down, up


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
