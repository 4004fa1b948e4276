"""Small pictures in the terminal, where it can show them: two pixels a character, in full colour."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.color import Color
from rich.console import Console
from rich.segment import Segment, Segments
from rich.style import Style

from semidense.pipeline.figures.colours import confidence_rgb, disparity_rgb, disparity_span, view_rgb
from semidense.pipeline.pages.scene_maps import step_for

if TYPE_CHECKING:
    import xarray as xr

COLUMNS, ROWS = 72, 24
"""Characters that a picture takes at most."""


def can_draw(console: Console) -> bool:
    """Return whether a console shows colours and half blocks: a terminal of 256 colours or more, without NO_COLOR."""
    colours = console.is_terminal and not console.no_color and console.color_system in ("truecolor", "256")
    return bool(colours) and "utf" in (console.encoding or "").lower()


def draw_picture(rgb: NDArray[np.uint8], legend: str = "", console: Console | None = None) -> bool:
    """Draw a picture if the terminal can show it; return whether it did.

    Args:
        rgb: (y, x, 3) uint8. Of a larger picture every n-th pixel is shown, so that no colour is one of a mixture:
            what is black has no value.
        legend: a line below, which says what the colours mean.
        console: where to; by default stdout.
    """
    console = console or Console(highlight=False)
    if not can_draw(console) or not rgb.size:
        return False
    shown = _fitted(rgb, min(COLUMNS, console.width), ROWS)
    console.print(Segments(_segments(shown)), end="")
    if legend:
        console.print(legend, style="dim", markup=False)
    return True


def _fitted(rgb: NDArray[np.uint8], columns: int, rows: int) -> NDArray[np.uint8]:
    """Return a picture of at most so many characters: even rows, the shape kept, pixels picked and not mixed."""
    height, width = rgb.shape[:2]
    shrink = max(width / columns, height / (2 * rows), 1)
    y = (np.arange(max(2, int(height / shrink) // 2 * 2)) * shrink).astype(int)
    x = (np.arange(max(1, int(width / shrink))) * shrink).astype(int)
    return rgb[np.ix_(np.minimum(y, height - 1), np.minimum(x, width - 1))]


def _segments(rgb: NDArray[np.uint8]) -> list[Segment]:
    """Return rows of upper half blocks: the upper pixel in the colour of the text, the lower in that behind it."""
    segments = []
    for upper, lower in zip(rgb[::2].tolist(), rgb[1::2].tolist(), strict=True):
        segments += [Segment("▀", _style(*pair)) for pair in zip(upper, lower, strict=True)]
        segments.append(Segment.line())
    return segments


def _style(upper: tuple[int, int, int], lower: tuple[int, int, int]) -> Style:
    return Style(color=Color.from_rgb(*upper), bgcolor=Color.from_rgb(*lower))


_PIXELS = 100_000
"""Of a map that a small picture is made from, about."""


class Small(NamedTuple):
    """A picture for a terminal: (y, x, 3) uint8, and its legend."""

    rgb: NDArray[np.uint8]
    legend: str


def small_picture(product: str, dataset: "xr.Dataset") -> Small | None:
    """Return a small picture of a product; None for one that is no map of a scene.

    Args:
        product: its name.
        dataset: as ``semidense.pipeline.results.opening.open_product`` gives it; every n-th pixel is read.
    """
    maps = [name for name in ("disparity", "confidence") if name in dataset and dataset[name].dims == ("y", "x")]
    if product != "images" and not maps:
        return None
    step = step_for(dataset.sizes["y"], dataset.sizes["x"], _PIXELS)
    thin = dataset.isel(y=slice(None, None, step), x=slice(None, None, step))
    if product == "images":
        return Small(view_rgb(thin["left"].values), "left view")
    if maps[0] == "confidence":
        return Small(confidence_rgb(thin["confidence"].values), "confidence: blue 0, yellow 1, black none")
    return small_disparity(thin["disparity"].values)


def small_disparity(disparity: NDArray[np.float32]) -> Small:
    """Return a small picture of a disparity map (y, x), px; NaN is black, and its share told of the whole map."""
    height, width = disparity.shape
    step = step_for(height, width, _PIXELS)
    low, high = disparity_span(disparity)
    share = 100 * np.count_nonzero(np.isnan(disparity)) / max(disparity.size, 1)
    legend = f"disparity: blue {low:g} px (far), yellow {high:g} px (near), black none ({share:.1f} %)"
    return Small(disparity_rgb(disparity[::step, ::step], low, high), legend)
