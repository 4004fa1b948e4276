"""What colours mean, as pieces of a page."""

import numpy as np
from matplotlib.colors import Colormap, to_hex

from pipeline.markup import Html, tag, text
from pipeline.views.colours import NONE, confidence_colours, disparity_colours
from pipeline.views.errors import ERROR_COLOURS, ERROR_LABELS, UNKNOWN

_STOPS = 12
"""Colours of a gradient."""


def disparity_legend(span: tuple[float, float], none: str) -> Html:
    """Return the legend of a disparity map; ``none`` says what black means."""
    return _gradient(disparity_colours(), f"{span[0]:g} px (far)", f"{span[1]:g} px (near)") + swatch(NONE, none)


def confidence_legend(none: str = "none") -> Html:
    """Return the legend of a confidence map."""
    return _gradient(confidence_colours(), "0 (wrong)", "1 (right)") + swatch(NONE, none)


def error_legend(shares: list[str] | None = None, none: str = "no disparity") -> Html:
    """Return the legend of a map of errors; with the share of each class, if they are given."""
    told = [f"{label}: {share}" for label, share in zip(ERROR_LABELS, shares, strict=True)] if shares else ERROR_LABELS
    classes = [swatch(colour, label) for colour, label in zip(ERROR_COLOURS, told, strict=True)]
    return "".join([*classes, swatch(NONE, none), swatch(UNKNOWN, "truth unknown")])


def _gradient(colours: Colormap, low: str, high: str) -> Html:
    stops = ", ".join(to_hex(each) for each in colours(np.linspace(0, 1, _STOPS)))
    bar = tag("span", class_="bar", style=f"background: linear-gradient(to right, {stops})")
    return tag("span", text(low), bar, text(high), class_="scale")


def swatch(colour: str, label: str) -> Html:
    """Return a colour and what it means."""
    return tag("span", tag("span", class_="swatch", style=f"background: {colour}"), text(label), class_="key")
