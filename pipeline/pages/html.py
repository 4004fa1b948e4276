"""HTML from values: every text is escaped where it enters."""

from collections.abc import Sequence
from html import escape
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.colors import Colormap, to_hex
from numpy.typing import NDArray

from semidense.pipeline.figures.colours import (
    CONFIDENCE_TICKS,
    ERROR_COLOURS,
    ERROR_LABELS,
    NONE,
    UNKNOWN,
    confidence_colours,
    confidence_share,
    disparity_colours,
)

Html = str
"""A piece of a page. Any other value becomes one through ``text``, which escapes it."""


def text(value: object) -> Html:
    """Return any value as escaped text for a page.

    >>> text("a < b")
    'a &lt; b'
    """
    return escape(str(value))


def tag(name: str, *content: Html, **attributes: object) -> Html:
    """Return an element. ``class_`` is the attribute ``class``, ``data_x`` is ``data-x``; None leaves it out.

    >>> tag("p", text("1 < 2"), class_="note")
    '<p class="note">1 &lt; 2</p>'
    """
    pairs = {key.rstrip("_").replace("_", "-"): value for key, value in attributes.items() if value is not None}
    written = "".join(f' {key}="{escape(str(value))}"' for key, value in pairs.items())
    return f"<{name}{written}>{''.join(content)}</{name}>"


def table(head: Sequence[str], rows: Sequence[Sequence[object]], *, caption: str, words: int = 1) -> Html:
    """Return a table that scrolls sideways by itself where it is too wide.

    Args:
        head: names of the columns, with units.
        rows: cells as text.
        caption: what the table shows, as text.
        words: columns on the left that hold words; the others hold numbers and stand at the right.
    """
    cells = [[("word" if i < words else "number", each) for i, each in enumerate(row)] for row in [head, *rows]]
    titles = "".join(tag("th", text(each), class_=kind, scope="col") for kind, each in cells[0])
    body = "".join(
        tag("tr", *(tag("th" if i == 0 else "td", text(each), class_=kind) for i, (kind, each) in enumerate(row)))
        for row in cells[1:]
    )
    inner = tag("caption", tag("span", text(caption))) + tag("thead", tag("tr", titles)) + tag("tbody", body)
    return tag("div", tag("table", inner), class_="scroll", tabindex=0, role="region", aria_label=caption)


def folded(summary: str, *content: Html) -> Html:
    """Return content that stays hidden until the reader opens it."""
    return tag("details", tag("summary", text(summary)), *content)


def missing(values: NDArray[Any] | None, what: str = "none") -> str:
    """Return ``what`` for the legend of a map that lacks values; nothing where every pixel has one.

    >>> missing(np.array([1, np.nan])), missing(np.array([1.0, 2.0]))
    ('none', '')
    """
    return what if values is not None and np.isnan(values).any() else ""


_STOPS = 12
"""Number of colours in the bar of a legend."""
_BAR = 7.5
"""Length of the bars of a scale together, em."""


def disparity_legend(span: tuple[float, float], none: str) -> Html:
    """Return the legend of a disparity map; ``none`` says what black means, and is empty where nothing is black."""
    ends = (f"{span[0]:g} px (far)", f"{span[1]:g} px (near)")
    return _gradient(disparity_colours(), ends, (0, 1)) + swatch(NONE, none)


def confidence_legend(none: str = "none") -> Html:
    """Return the legend of a confidence map: a bar between each two confidences that are named; black as above."""
    shares = confidence_share(np.array(CONFIDENCE_TICKS)).tolist()
    return _gradient(confidence_colours(), [f"{each:g}" for each in CONFIDENCE_TICKS], shares) + swatch(NONE, none)


def error_legend(shares: Sequence[str] = (), none: str = "no disparity", unknown: str = "truth unknown") -> Html:
    """Return the legend of a map of errors.

    Args:
        shares: the share of each class, to be written beside it.
        none: what black means; empty where the map has no black pixel.
        unknown: what gray means; empty where the map has no gray pixel.
    """
    told = [f"{label}: {share}" for label, share in zip(ERROR_LABELS, shares, strict=True)] if shares else ERROR_LABELS
    classes = [swatch(colour, label) for colour, label in zip(ERROR_COLOURS, told, strict=True)]
    return "".join([*classes, swatch(NONE, none), swatch(UNKNOWN, unknown)])


def _gradient(colours: Colormap, labels: Sequence[str], places: Sequence[float]) -> Html:
    """Return a scale: labels at places between 0 and 1, and a bar of colours between each two."""
    width = f"{_BAR / (len(labels) - 1):.3g}em"
    bars = [_bar(colours, *ends, width) for ends in pairwise(places)]
    parts = [part for label, bar in zip(labels, [*bars, ""], strict=True) for part in (text(label), bar)]
    return tag("span", *parts, class_="scale")


def _bar(colours: Colormap, start: float, end: float, width: str) -> Html:
    stops = ", ".join(to_hex(each) for each in colours(np.linspace(start, end, _STOPS)))
    return tag("span", class_="bar", style=f"width: {width}; background: linear-gradient(to right, {stops})")


def swatch(colour: str, label: str) -> Html:
    """Return a legend entry: a colour and its meaning; nothing for a colour without one."""
    box = tag("span", class_="swatch", style=f"background: {colour}")
    return tag("span", box, text(label), class_="key") if label else ""
