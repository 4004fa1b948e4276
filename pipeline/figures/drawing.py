"""The parts of figures: axes in pixels, maps with a colour bar, legends that say what is missing."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, FuncNorm, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Patch
from numpy.typing import NDArray

from semidense.pipeline.figures.colours import (
    CONFIDENCE_TICKS,
    NONE,
    confidence_at,
    confidence_colours,
    confidence_share,
    disparity_colours,
    disparity_span,
)

PANEL = 6.0
"""Width of the panel of an image, inches."""
_MARGINS = (1.5, 0.95)
"""Width and height that a panel needs beside its image: labels, title, colour bar; inches."""
_HEAD = 0.75
"""Height of the figure's title and legend, inches."""
_DPI = 150
_TITLE = 72
"""Characters of a line of the title: what fits above a single map."""


@dataclass(frozen=True)
class Scale:
    """A scale of colours.

    Attributes:
        colours: from low to high; "bad" is the colour of none.
        low: value of the first colour.
        high: value of the last colour.
        label: quantity and unit, for the colour bar.
        ticks: values that are written beside it; None leaves them to Matplotlib.
        places: where values lie between low and high, as 0 to 1, and the inverse; None is a straight scale.
    """

    colours: Colormap
    low: float
    high: float
    label: str
    ticks: tuple[float, ...] | None = None
    places: tuple[Callable[..., Any], Callable[..., Any]] | None = None

    def norm(self) -> Normalize:
        """Return Matplotlib's form of the scale."""
        return FuncNorm(self.places, self.low, self.high) if self.places else Normalize(self.low, self.high)


def confidence_scale() -> Scale:
    """Return the scale of confidence maps: log-odds, so that the middle can be seen."""
    low, high = CONFIDENCE_TICKS[0], CONFIDENCE_TICKS[-1]
    places = confidence_share, confidence_at
    return Scale(confidence_colours(), low, high, "confidence (0 to 1)", CONFIDENCE_TICKS, places)


def disparity_scale(disparity: NDArray[Any], label: str = "disparity (px)") -> Scale:
    """Return the scale of a disparity map."""
    return Scale(disparity_colours(), *disparity_span(disparity), label)


def new_figure(title: str) -> Figure:
    """Return an empty figure under a title, which is taken literally: a scene's name is not read as mathematics."""
    figure = Figure(dpi=_DPI, layout=ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.1))
    figure.suptitle(fill(title, _TITLE), fontsize="large", fontweight="bold", parse_math=False)
    return figure


def image_panels(
    figure: Figure, size: tuple[int, int], rows: int = 1, columns: int = 1, least_height: float = 1.0
) -> NDArray[Any]:
    """Return (row, column) axes for images of ``size``, rows and columns in px, in a figure of fitting size.

    A panel is at least ``least_height`` inches high, and at most twice as high as it is wide.
    """
    height = float(np.clip(PANEL * size[0] / size[1], least_height, 2 * PANEL))
    figure.set_size_inches(columns * (PANEL + _MARGINS[0]), rows * (height + _MARGINS[1]) + _HEAD)
    axes: NDArray[Any] = figure.subplots(rows, columns, squeeze=False)
    for each in axes.flat:
        each.set(xlabel="x (px)", ylabel="y (px)")
    return axes


def draw_map(axes: Axes, values: NDArray[Any], scale: Scale) -> None:
    """Draw a map (y, x) with its colour bar; arrows on the bar say that values lie beyond its ends."""
    masked = np.ma.masked_invalid(values)
    picture = axes.imshow(masked, cmap=scale.colours, norm=scale.norm(), interpolation="nearest")
    known = values[np.isfinite(values)]
    below, above = bool((known < scale.low).any()), bool((known > scale.high).any())
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get((below, above), "neither")
    # An inset is as high as the image, whatever room the layout leaves around it.
    place = axes.inset_axes((1.02, 0, 0.035, 1))
    bar = axes.figure.colorbar(picture, cax=place, label=scale.label, extend=extend)
    if scale.ticks:
        bar.set_ticks(list(scale.ticks), labels=[f"{each:g}" for each in scale.ticks])


def draw_classes(axes: Axes, classes: NDArray[Any], colours: Sequence[str]) -> None:
    """Draw a map (y, x) of whole numbers from 0 in one colour each."""
    axes.imshow(classes, cmap=ListedColormap(colours), vmin=-0.5, vmax=len(colours) - 0.5, interpolation="nearest")


def none_patch(values: NDArray[Any], name: str = "none") -> Patch:
    """Return the legend's entry for pixels without a value, with their share.

    >>> none_patch(np.array([[1.0, np.nan]])).get_label()
    'none: 50.0 %'
    """
    return share_patch(~np.isfinite(values), name, NONE)


def share_patch(chosen: NDArray[np.bool_], name: str, colour: str) -> Patch:
    """Return a legend's entry with the share of the chosen pixels."""
    share = 100 * np.count_nonzero(chosen) / max(chosen.size, 1)
    return Patch(facecolor=colour, edgecolor="#606060", label=f"{name}: {share:.1f} %")


def legend_below(figure: Figure, handles: Sequence[Artist]) -> None:
    """Put one legend for the whole figure below its panels."""
    figure.legend(handles=list(handles), loc="outside lower center", ncols=min(len(handles), 3), frameon=False)
