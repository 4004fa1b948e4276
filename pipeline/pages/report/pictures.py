"""Maps as pictures inside the page: small files, one colour for "none", and a legend that says what colours mean."""

import base64
import io
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.colors import Colormap, to_hex, to_rgb
from numpy.typing import NDArray
from PIL import Image

from semidense.pipeline.figures.colours import (
    BLUE,
    ERROR_COLOURS,
    NONE,
    QUIET,
    SKY,
    UNKNOWN,
    confidence_colours,
    confidence_share,
    disparity_colours,
    error_classes,
)
from semidense.pipeline.pages.html import Html, confidence_legend, disparity_legend, error_legend, missing, tag, text

_OWN = {
    "#000000": "currentColor",
    "#ffffff": "var(--paper)",
    BLUE.lower(): "var(--blue)",
    SKY.lower(): "var(--sky)",
    QUIET.lower(): "var(--back)",
}
"""Colours of charts, and the page's colours that replace them."""
_LEVELS = 254
"""Number of colours of a map, without the two for no value and unknown truth."""


@dataclass(frozen=True)
class Picture:
    """A picture with its legend.

    Attributes:
        title: what the picture shows.
        source: a ``data:`` address.
        legend: what its colours mean.
    """

    title: str
    source: str
    legend: Html


def photo(title: str, view: NDArray[np.uint8]) -> Picture:
    """Return a picture of a view (y, x, 3)."""
    return Picture(
        title, _address(Image.fromarray(np.ascontiguousarray(view)), "JPEG", quality=88), text("as it was taken")
    )


def disparity_picture(title: str, disparity: NDArray[Any], span: tuple[float, float], none: str) -> Picture:
    """Return a disparity map; ``none`` says what a missing value means, if there is one."""
    legend = disparity_legend(span, missing(disparity, none))
    return Picture(title, _scaled(disparity, span, disparity_colours()), legend)


def confidence_picture(title: str, confidence: NDArray[Any]) -> Picture:
    """Return a confidence map on the scale of log-odds."""
    legend = confidence_legend(missing(confidence))
    return Picture(title, _scaled(confidence_share(confidence), (0, 1), confidence_colours()), legend)


def _scaled(values: NDArray[Any], span: tuple[float, float], colours: Colormap) -> str:
    """Return the address of a map in the colours of a scale."""
    known = np.isfinite(values)
    share = np.clip((np.where(known, values, span[0]) - span[0]) / (span[1] - span[0]), 0, 1)
    levels = np.where(known, 2 + np.rint(share * (_LEVELS - 1)), 0).astype(np.uint8)
    palette = [NONE, UNKNOWN, *(to_hex(each) for each in colours(np.linspace(0, 1, _LEVELS)))]
    return _indexed(levels, palette)


def error_picture(title: str, error: NDArray[Any], truth: NDArray[Any], nonocc: NDArray[np.bool_]) -> Picture:
    """Return an error map in classes; black where the map has no disparity, gray where the truth is not known.

    The legend gives the share of each class among the ``nonocc`` pixels.
    """
    unknown, none = ~np.isfinite(truth), np.isfinite(truth) & np.isnan(error)
    classes = np.nan_to_num(error_classes(error), nan=0).astype(np.uint8) + 2
    levels = np.where(unknown, 1, np.where(none, 0, classes)).astype(np.uint8)
    counted = levels[nonocc & ~unknown]
    shares = [percent(counted == index + 2) for index in range(len(ERROR_COLOURS))]
    none_told = f"no disparity: {percent(counted == 0)}" if none.any() else ""
    legend = error_legend(shares, none_told, "truth unknown" if unknown.any() else "")
    told = tag("span", text("shares of the nonocc pixels:"))
    return Picture(title, _indexed(levels, [NONE, UNKNOWN, *ERROR_COLOURS]), told + legend)


def percent(chosen: NDArray[np.bool_]) -> str:
    """Return the share of the chosen pixels as text: ``12.3 %``."""
    return f"{100 * np.count_nonzero(chosen) / max(chosen.size, 1):.1f} %"


def _indexed(levels: NDArray[np.uint8], palette: list[str]) -> str:
    image = Image.fromarray(levels, "L").convert("L")
    image = Image.frombytes("P", image.size, image.tobytes())
    image.putpalette((255 * np.array([to_rgb(each) for each in palette])).round().astype(np.uint8).tobytes())
    return _address(image, "PNG", optimize=True)


def _address(image: Image.Image, form: str, **how: Any) -> str:  # noqa: ANN401
    file = io.BytesIO()
    image.save(file, form, **how)
    return f"data:image/{form.lower()};base64,{base64.b64encode(file.getvalue()).decode('ascii')}"


def svg(figure: Any, label: str) -> Html:  # noqa: ANN401
    """Return a chart as a drawing in the page's own colours, so that it can be read in light and dark alike.

    Args:
        figure: a Matplotlib figure.
        label: what the chart shows, for readers who cannot see it.
    """
    file = io.BytesIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": label}):
        figure.savefig(file, format="svg", transparent=True, metadata={"Date": None})
    drawing = file.getvalue().decode("utf-8").partition("<svg")[2]
    for colour, own in _OWN.items():
        drawing = drawing.replace(colour, own)
    return tag("figure", f'<svg role="img" aria-label="{text(label)}"{drawing}', class_="chart", tabindex=0)
