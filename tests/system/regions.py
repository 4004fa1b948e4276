"""Paint regions without information into both views of a real pair: any shape, value, gradient and period."""

import io
from collections.abc import Callable
from dataclasses import dataclass

import imageio.v3 as iio
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Floats = NDArray[np.float64]
Draw = np.random.Generator


@dataclass(frozen=True)
class Painted:
    """A pair with a region that neither view tells anything about.

    Attributes:
        name: what was painted.
        left, right: (y, x, 3) uint8.
        region: (y, x) bool, in both views at the same place.
    """

    name: str
    left: Image
    right: Image
    region: NDArray[np.bool_]


def band(draw: Draw, y: Floats, x: Floats) -> NDArray[np.bool_]:
    return np.broadcast_to(_span(draw, y, 24), (y.size, x.size))


def pillar(draw: Draw, y: Floats, x: Floats) -> NDArray[np.bool_]:
    return np.broadcast_to(_span(draw, x, 40), (y.size, x.size))


def rectangle(draw: Draw, y: Floats, x: Floats) -> NDArray[np.bool_]:
    return _span(draw, y, 30) & _span(draw, x, 48)


def ellipse(draw: Draw, y: Floats, x: Floats) -> NDArray[np.bool_]:
    height, width = draw.uniform(0.15, 0.3) * y.size, draw.uniform(0.15, 0.3) * x.size
    down, across = draw.uniform(0.3, 0.7) * y.size, draw.uniform(0.3, 0.7) * x.size
    return ((y - down) / height) ** 2 + ((x - across) / width) ** 2 <= 1


def wedge(draw: Draw, y: Floats, x: Floats) -> NDArray[np.bool_]:
    return y - draw.uniform(0.2, 0.5) * y.size >= draw.uniform(0.2, 1) * np.abs(x - draw.uniform(0.2, 0.8) * x.size)


def everything(_: Draw, y: Floats, x: Floats) -> NDArray[np.bool_]:
    return np.ones((y.size, x.size), bool)


def _span(draw: Draw, along: Floats, least: int) -> NDArray[np.bool_]:
    """Return a stretch of at least so many pixels, at most half of the image."""
    length = int(draw.integers(least, max(least + 1, along.size // 2)))
    first = int(draw.integers(0, along.size - length + 1))
    return (along >= first) & (along < first + length)


def constant(draw: Draw, y: Floats, x: Floats) -> tuple[Floats, Floats]:
    value = np.full((y.size, x.size), draw.integers(0, 256), float)
    return value, value


def different(draw: Draw, y: Floats, x: Floats) -> tuple[Floats, Floats]:
    return constant(draw, y, x)[0], constant(draw, y, x)[0]


def vertical_gradient(draw: Draw, y: Floats, x: Floats) -> tuple[Floats, Floats]:
    first, last = draw.integers(0, 256, 2)
    value = np.broadcast_to(first + (last - first) * y / y.size, (y.size, x.size))
    return value, value


def rows(draw: Draw, y: Floats, x: Floats) -> tuple[Floats, Floats]:
    dark, bright = _contrast(draw)
    value = np.broadcast_to(np.where(y % (period := draw.integers(2, 25)) < period / 2, dark, bright), (y.size, x.size))
    return value, value


def columns(draw: Draw, y: Floats, x: Floats) -> tuple[Floats, Floats]:
    """Stripes of a period up to 16 px, sharp or smooth, at a true disparity up to 20 px."""
    (dark, bright), period, disparity = _contrast(draw), draw.integers(3, 17), draw.integers(0, 21)
    sharp = draw.random() < 0.7
    views = []
    for shift in (0, disparity):
        phase = np.broadcast_to((x + shift) % period / period, (y.size, x.size))
        share = (phase < 0.5).astype(float) if sharp else (1 + np.sin(2 * np.pi * phase)) / 2
        views.append(dark + (bright - dark) * share)
    return views[0], views[1]


def _contrast(draw: Draw) -> tuple[float, float]:
    dark = draw.integers(0, 150)
    return float(dark), float(dark + draw.integers(30, 106))


SHAPES: tuple[Callable[[Draw, Floats, Floats], NDArray[np.bool_]], ...] = (
    band,
    pillar,
    rectangle,
    ellipse,
    wedge,
    everything,
)
SURFACES: tuple[Callable[[Draw, Floats, Floats], tuple[Floats, Floats]], ...] = (
    constant,
    different,
    vertical_gradient,
    rows,
    columns,
)


def paint(left: Image, right: Image, seed: int) -> Painted:
    """Return the pair with a random region; a third of the pairs goes through a JPEG file of quality 60 to 95."""
    draw = np.random.default_rng(seed)
    shape, surface = SHAPES[draw.integers(len(SHAPES))], SURFACES[seed % len(SURFACES)]
    y, x = np.arange(left.shape[0], dtype=float)[:, np.newaxis], np.arange(left.shape[1], dtype=float)[np.newaxis]
    region = shape(draw, y, x)
    values = surface(draw, y, x)
    views = [
        np.where(region[..., None], value[..., None], view) for value, view in zip(values, (left, right), strict=True)
    ]
    name, quality = f"{surface.__name__}, {shape.__name__}, seed {seed}", int(draw.integers(60, 96))
    first, second = (np.rint(view).clip(0, 255).astype(np.uint8) for view in views)
    if draw.random() < 1 / 3:
        first, second, name = _jpeg(first, quality), _jpeg(second, quality), f"{name}, JPEG {quality}"
    return Painted(name, first, second, region)


def _jpeg(view: Image, quality: int) -> Image:
    file = io.BytesIO()
    iio.imwrite(file, view, extension=".jpg", quality=quality)
    return np.asarray(iio.imread(file.getvalue(), extension=".jpg"), np.uint8)
