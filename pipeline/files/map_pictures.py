"""Draw a map as a picture with a title, a colour bar and the share of pixels without a value.

The picture is made of pixels, without Matplotlib's figures: these take longer to draw than a pair takes to match.
"""

from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from textwrap import wrap
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from semidense.pipeline.figures.colours import (
    CONFIDENCE_TICKS,
    NONE,
    confidence_at,
    confidence_rgb,
    confidence_share,
    disparity_rgb,
    disparity_span,
)

Colours = Callable[[NDArray[Any]], NDArray[np.uint8]]
"""From a map (y, x) to its colours (y, x, 3)."""
_LEAST = 480
"""A map whose longer side is shorter, px, is enlarged by a whole number, so that its title has room."""
_LETTER = 50
"""The longer side of the map is so many letters high, and a letter is 12 px high at least."""
_TICKS = 5
_BESIDE = 7
"""Room at the right for the colour bar and its numbers, letters high."""


class Bar(NamedTuple):
    """A colour bar, whose places go from 0 at its lower end to 1.

    Attributes:
        values: gives the values at some places.
        ticks: place and text of the numbers beside it.
    """

    values: Callable[[NDArray[Any]], NDArray[Any]]
    ticks: Sequence[tuple[float, str]]


def disparity_picture(disparity: NDArray[Any], title: str) -> NDArray[np.uint8]:
    """Return a disparity map (y, x), px, as a picture: (row, column, 3) uint8 RGB, black where there is none."""
    low, high = disparity_span(disparity)
    places = np.linspace(0, 1, _TICKS).tolist()
    bar = Bar(lambda place: low + place * (high - low), [(each, f"{low + each * (high - low):.4g}") for each in places])
    return _picture(disparity, partial(disparity_rgb, vmin=low, vmax=high), bar, title)


def confidence_picture(confidence: NDArray[Any], title: str) -> NDArray[np.uint8]:
    """Return a confidence map (y, x), in [0, 1], as a picture: (row, column, 3) uint8 RGB, black where it is NaN.

    The bar is a scale of log-odds, as the colours are: on a straight one most of it would have two colours.
    """
    places = confidence_share(np.array(CONFIDENCE_TICKS)).tolist()
    bar = Bar(confidence_at, [(place, f"{each:g}") for place, each in zip(places, CONFIDENCE_TICKS, strict=True)])
    return _picture(confidence, confidence_rgb, bar, title)


def _picture(values: NDArray[Any], colours: Colours, bar: Bar, title: str) -> NDArray[np.uint8]:
    """Return the map under its title, its colour bar at the right, what black means below if there is any."""
    rgb = _enlarged(colours(values))
    height, width = rgb.shape[:2]
    letter = max(12, max(height, width) // _LETTER)
    lines = wrap(title, int(1.6 * (width + (_BESIDE - 1) * letter) / letter))
    top, right = (len(lines) + 1) * 3 * letter // 2, width + 2 * letter
    page = Image.new("RGB", (width + _BESIDE * letter, top + height + 3 * letter), "white")
    pen = ImageDraw.Draw(page)
    for row, line in enumerate(lines):
        pen.text((letter, letter // 2 + row * 3 * letter // 2), line, "black", _font(letter))
    page.paste(Image.fromarray(rgb), (letter, top))
    _draw_bar(page, pen, (right, top, height, letter), colours, bar)
    share = 100 * np.count_nonzero(~np.isfinite(values)) / max(values.size, 1)
    if share:
        pen.rectangle((letter, top + height + letter, 2 * letter, top + height + 2 * letter), NONE)
        pen.text((5 * letter // 2, top + height + letter), f"none: {share:.1f} %", "black", _font(letter))
    return np.asarray(page)


def _enlarged(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return colours with each pixel repeated, so that the longer side has ``_LEAST`` px or more."""
    times = -(-_LEAST // max(rgb.shape[:2]))
    return rgb.repeat(times, axis=0).repeat(times, axis=1)


def _draw_bar(
    page: Image.Image,
    pen: ImageDraw.ImageDraw,
    place: tuple[int, int, int, int],
    colours: Colours,
    bar: Bar,
) -> None:
    """Draw the colours from high to low, with numbers beside them; place: x, y, height, and height of a letter."""
    x, y, height, letter = place
    column = colours(bar.values(np.linspace(1, 0, height))[:, np.newaxis])
    page.paste(Image.fromarray(column.repeat(letter, axis=1)), (x, y))
    for tick, told in bar.ticks:
        row = y + round((height - 1) * (1 - tick))
        pen.line((x + letter, row, x + 4 * letter // 3, row), "black")
        pen.text((x + 3 * letter // 2, row), told, "black", _font(letter), anchor="lm")


@cache
def _font(letter: int) -> ImageFont.FreeTypeFont:
    """Return the font of the other figures, which knows many scripts; Matplotlib brings it."""
    return ImageFont.truetype(str(Path(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")), letter)
