"""Colours that colour-blind readers can tell apart; black, for pixels without a value, is on no scale.

The maps are perceptually even. The dark ends are cut off, so that black, which stands for
"none", is far from every colour in use, as seen with any of the common kinds of colour blindness.
"""

from functools import cache
from itertools import pairwise
from typing import Any

import matplotlib
import numpy as np
from matplotlib.colors import Colormap, ListedColormap
from numpy.typing import NDArray

from semidense.pipeline.plan.errors import UsageError
from semidense.stages.metrics.errors import THRESHOLDS

NONE = "#000000"
"""A pixel without a value."""
ORANGE, SKY, GREEN, YELLOW, BLUE, RED, PURPLE = (
    *("#E69F00", "#56B4E9", "#009E73", "#F0E442"),
    *("#0072B2", "#D55E00", "#CC79A7"),
)
"""The palette of Okabe and Ito (2008)."""
LINES = (BLUE, RED, GREEN, ORANGE, PURPLE, SKY)
"""Colours of lines on white, in the order in which they are used."""
QUIET = "#B0B0B0"
"""The colour of what is less important than the rest."""
_CLIPPED = 0.5


def view_rgb(view: NDArray[Any]) -> NDArray[np.uint8]:
    """Return a view of the pair as 8-bit colours, to look at.

    Args:
        view: (..., band) uint8 or uint16, one band or three; 16 bits are divided by 257, to the nearest whole number.

    Returns:
        (..., 3) uint8 RGB.

    >>> view_rgb(np.array([[[0], [128], [129], [65535]]], np.uint16))[0, :, 0].tolist()
    [0, 0, 1, 255]
    """
    eight = ((view.astype(np.uint32) + 128) // 257).astype(np.uint8) if view.dtype == np.uint16 else view
    return np.broadcast_to(eight, (*eight.shape[:-1], 3))


@cache
def disparity_colours() -> Colormap:
    """Return the colours of disparities: near is yellow, far is blue, missing is black."""
    return _part("viridis", 0.2, 1)


@cache
def confidence_colours() -> Colormap:
    """Return the colours of ``confidence_share``, different from a disparity's: sure is yellow, missing is black."""
    return _part("cividis", 0.15, 1)


CONFIDENCE_TICKS = (0.01, 0.1, 0.5, 0.9, 0.99)
"""Confidences that are written beside a scale; the first and the last are its ends."""


def confidence_share(confidence: NDArray[Any]) -> NDArray[Any]:
    """Return where confidences lie on the scale of colours: their log-odds from 0.01 to 0.99, as 0 to 1; NaN stays.

    Most confidences are near 0 or 1. On a straight scale they would have two colours, and those between would be hard
    to find.

    >>> confidence_share(np.array([0, 0.01, 0.5, 0.9, 1])).round(2).tolist()
    [0.0, 0.0, 0.5, 0.74, 1.0]
    """
    low, high = CONFIDENCE_TICKS[0], CONFIDENCE_TICKS[-1]
    known = np.clip(confidence, low, high)
    share: NDArray[Any] = 0.5 + np.log(known / (1 - known)) / (2 * np.log(high / low))
    return share


def confidence_at(share: NDArray[Any]) -> NDArray[Any]:
    """Return the confidence at a place of the scale: the inverse of ``confidence_share``."""
    low, high = CONFIDENCE_TICKS[0], CONFIDENCE_TICKS[-1]
    odds = (high / low) ** (2 * share - 1)
    confidence: NDArray[Any] = odds / (1 + odds)
    return confidence


@cache
def cost_colours() -> Colormap:
    """Return the colours of costs: a match is orange, a mismatch purple, undecided white, missing black."""
    return _part("PuOr", 0.1, 0.9)


def _part(name: str, start: float, end: float) -> Colormap:
    return ListedColormap(matplotlib.colormaps[name](np.linspace(start, end, 256))).with_extremes(bad=NONE)


def disparity_rgb(disparity: NDArray[Any], vmin: float, vmax: float) -> NDArray[np.uint8]:
    """Return a disparity map in colours, pixel by pixel.

    Args:
        disparity: (y, x) float, px; NaN and infinity are none.
        vmin: px, the disparity of the first colour; smaller ones get it too.
        vmax: px, above ``vmin``: the disparity of the last colour; larger ones get it too.

    Returns:
        (y, x, 3) uint8 RGB; black where there is no disparity.

    Raises:
        UsageError: if ``vmin`` is not below ``vmax``, or the map is not (y, x).

    >>> disparity_rgb(np.array([[np.nan, 60.0]]), 0, 60).tolist()
    [[[0, 0, 0], [253, 231, 36]]]
    """
    return _rgb(disparity, vmin, vmax, disparity_colours())


def confidence_rgb(confidence: NDArray[Any]) -> NDArray[np.uint8]:
    """Return a confidence map (y, x) in [0, 1] in colours of its log-odds: (y, x, 3) uint8 RGB, black where it is NaN.

    Raises:
        UsageError: if the map is not (y, x).
    """
    return _rgb(confidence_share(confidence), 0, 1, confidence_colours())


def _rgb(values: NDArray[Any], vmin: float, vmax: float, colours: Colormap) -> NDArray[np.uint8]:
    if values.ndim != 2 or not vmin < vmax:
        raise UsageError(f"a map of shape {values.shape} from {vmin:g} to {vmax:g}: give (y, x), from low to high")
    known = np.isfinite(values)
    share = (np.where(known, values, vmin).astype(np.float64) - vmin) / (vmax - vmin)
    rgb: NDArray[np.uint8] = colours(np.clip(share, 0, 1), bytes=True)[..., :3]
    return np.where(known[..., np.newaxis], rgb, np.uint8(0))


def disparity_span(disparity: NDArray[Any]) -> tuple[float, float]:
    """Return the disparities of the first and the last colour of a map, whole px.

    The lowest and the highest 0.5 % may lie beyond, so that a few wild errors do not take all colours. A map without
    any disparity gets (0, 1).

    >>> disparity_span(np.array([[3.5, 7.25, np.nan]]))
    (3.0, 8.0)
    """
    known = disparity[np.isfinite(disparity)]
    if not known.size:
        return 0.0, 1.0
    low, high = np.percentile(known.astype(np.float64), (_CLIPPED, 100 - _CLIPPED))
    first = float(np.floor(low))
    return first, max(float(np.ceil(high)), first + 1)


ERROR_COLOURS = ("#FFF7BC", "#FEC44F", "#F2780C", "#C02A0A", "#6A0532")
"""Colours of errors up to each of ``THRESHOLDS``, and above the last: lighter is better."""
ERROR_LABELS = (
    f"at most {THRESHOLDS[0]:g} px",
    *(f"{low:g} to {high:g} px" for low, high in pairwise(THRESHOLDS)),
    f"above {THRESHOLDS[-1]:g} px",
)
UNKNOWN = "#8A8A8A"
"""A pixel whose truth is not known."""


def error_classes(error: NDArray[Any]) -> NDArray[np.float32]:
    """Return the class of each error, 0 to 4, as float32; NaN stays NaN.

    >>> error_classes(np.array([0.5, 0.6, 5.0, np.nan])).tolist()
    [0.0, 1.0, 4.0, nan]
    """
    return np.where(np.isnan(error), np.nan, np.searchsorted(THRESHOLDS, error, side="left")).astype(np.float32)
