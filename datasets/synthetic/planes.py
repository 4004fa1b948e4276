"""Render a world of textured planes from two eyes, with a ground truth that is exact.

A plane's disparity is linear in the left view, ``d = a x + b y + c``, so that its point at ``x`` there is at ``x - d``
in the right view, and the point seen at ``x`` in the right view is at ``(x + b y + c) / (1 - a)`` in the left. Colours
are continuous functions of the left position, evaluated where they are needed: no image is resampled, and truth and
visibility have no error but that of float64.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from semidense.datasets.arrays import DisparityMap, Mask

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Waves:
    """Sum plane waves into a band-limited noise of mean 0.

    Attributes:
        frequencies: (wave, 2) cycles a pixel, along x and y.
        phases: (wave,) radians.
        weights: (wave, channel).
    """

    frequencies: Floats
    phases: Floats
    weights: Floats

    def __call__(self, x: Floats, y: Floats) -> Floats:
        """Evaluate at any positions: arrays of one shape give that shape and a channel axis."""
        total = np.zeros((*x.shape, self.weights.shape[1]))
        for (along_x, along_y), phase, weight in zip(self.frequencies, self.phases, self.weights, strict=True):
            total += np.cos(2 * np.pi * (along_x * x + along_y * y) + phase)[..., np.newaxis] * weight
        return total


@dataclass(frozen=True, eq=False)
class Plane:
    """Hold one textured plane, bounded by an ellipse or a rectangle of the left view.

    Attributes:
        slope: ``(a, b)`` of the disparity ``d = a x + b y + c``, pixels of disparity a pixel; ``a < 1``.
        offset: ``c``, pixels.
        centre: x and y of the outline's middle.
        half: Its half width and half height; infinite for a background.
        round: Whether the outline is an ellipse.
        colour: (channel,) mean gray level.
        texture: Gray levels around the mean.
        flatness: A slow noise of one channel: where it is below ``threshold`` the plane has no texture.
        threshold: See ``flatness``; minus infinity for texture everywhere.
    """

    slope: tuple[float, float]
    offset: float
    centre: tuple[float, float]
    half: tuple[float, float]
    round: bool
    colour: Floats
    texture: Waves
    flatness: Waves
    threshold: float

    def disparity(self, x: Floats, y: Floats) -> Floats:
        """Give the disparity at positions of the left view."""
        return self.slope[0] * x + self.slope[1] * y + self.offset

    def left_column(self, x_right: Floats, y: Floats) -> Floats:
        """Give the left column of what is seen at positions of the right view."""
        return (x_right + self.slope[1] * y + self.offset) / (1 - self.slope[0])

    def covers(self, x: Floats, y: Floats) -> Mask:
        """Tell whether positions of the left view are inside the outline."""
        across = (x - self.centre[0]) / self.half[0]
        down = (y - self.centre[1]) / self.half[1]
        inside = across**2 + down**2 <= 1 if self.round else np.maximum(np.abs(across), np.abs(down)) <= 1
        return np.asarray(inside, dtype=np.bool_)

    def shade(self, x: Floats, y: Floats) -> Floats:
        """Give the gray levels, not rounded, at positions of the left view: a channel axis is added."""
        textured = self.flatness(x, y)[..., 0] >= self.threshold
        return self.colour + self.texture(x, y) * textured[..., np.newaxis]


@dataclass(frozen=True, eq=False)
class World:
    """Look at planes from the left and from the right; the first plane must cover everything.

    Attributes:
        planes: In any order: the largest disparity is nearest and wins, the first one on a tie.
        height: Rows of both views.
        width: Columns of both views.
    """

    planes: Sequence[Plane]
    height: int
    width: int

    @cached_property
    def _grid(self) -> tuple[Floats, Floats]:
        rows, columns = np.mgrid[: self.height, : self.width].astype(np.float64)
        return columns, rows

    def left_truth(self) -> DisparityMap:
        """Give the left view's disparity, (y, x) pixels."""
        columns, rows = self._grid
        return self._nearest([columns] * len(self.planes), rows)[1].astype(np.float32)

    def right_truth(self) -> DisparityMap:
        """Give the right view's disparity, (y, x) pixels: ``x_left = x_right + d``."""
        columns, rows = self._grid
        return self._nearest(self._left_columns(columns), rows)[1].astype(np.float32)

    def visible(self) -> Mask:
        """Mark the left pixels whose point is inside the right view and is the nearest one there."""
        columns, rows = self._grid
        plane, disparity = self._nearest([columns] * len(self.planes), rows)
        landing = columns - disparity
        seen, _ = self._nearest(self._left_columns(landing), rows)
        inside: Mask = (landing >= 0) & (landing <= self.width - 1) & (seen == plane)
        return inside

    def left_view(self) -> Floats:
        """Give the left view's gray levels, (y, x, channel), not rounded."""
        return self._shade([self._grid[0]] * len(self.planes))

    def right_view(self) -> Floats:
        """Give the right view's gray levels, (y, x, channel), not rounded."""
        return self._shade(self._left_columns(self._grid[0]))

    def _left_columns(self, x_right: Floats) -> list[Floats]:
        return [plane.left_column(x_right, self._grid[1]) for plane in self.planes]

    def _nearest(self, columns: Sequence[Floats], rows: Floats) -> tuple[npt.NDArray[np.intp], Floats]:
        """Find the nearest plane and its disparity, given each plane's left columns."""
        depths = [
            np.where(plane.covers(x, rows), plane.disparity(x, rows), -np.inf)
            for plane, x in zip(self.planes, columns, strict=True)
        ]
        stacked = np.stack(depths)
        plane: npt.NDArray[np.intp] = stacked.argmax(axis=0)
        return plane, stacked.max(axis=0)

    def _shade(self, columns: Sequence[Floats]) -> Floats:
        rows = self._grid[1]
        seen, _ = self._nearest(columns, rows)
        image = np.empty((*rows.shape, len(self.planes[0].colour)))
        for index, (plane, x) in enumerate(zip(self.planes, columns, strict=True)):
            here = seen == index
            image[here] = plane.shade(x[here], rows[here])
        return image
