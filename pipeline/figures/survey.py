"""Draw what a look at a pair found: how far each match moved along its row and across it."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import Colormap
from matplotlib.figure import Figure
from numpy.typing import NDArray

from semidense.pipeline.figures.colours import cost_colours, disparity_colours
from semidense.pipeline.figures.drawing import image_panels
from semidense.stages.disparity.survey import FIELDS

_LEAST_SPAN = 2.0
"""Least vertical offset at the ends of its scale, px."""
_LEAST_SHIFT = 0.5
"""The same where offsets are measured to a fraction of a pixel."""


def draw_survey(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw the matches on the left view, coloured by disparity and by vertical offset."""
    matches = dict(zip(FIELDS, dataset["matches"].values.T, strict=True))
    step, view = int(dataset["step"].values[0]), dataset["left"].values
    low, high = dataset["range"].values
    axes = image_panels(figure, view.shape, columns=2)[0]
    _draw_matches(axes[0], view, step, matches, "disparity", disparity_colours())
    told = f"range to search {low:g} to {high:g} px" if np.isfinite(low) else "too few for a range"
    axes[0].set_title(f"{matches['y'].size} matches; {told}")
    _draw_matches(axes[1], view, step, matches, "vertical", cost_colours())
    middle = f"median {np.median(matches['vertical']):+.1f} px" if matches["y"].size else "none measured"
    axes[1].set_title(f"vertical offset, 0 in a rectified pair: {middle}")


def draw_alignment(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw how far the right view lies below the left one, and as dots on it where that was measured."""
    offset = dataset["rows"].values[:, None] + dataset["columns"].values
    y, x, measured = dataset["offsets"].values.T
    (axes,) = image_panels(figure, offset.shape, columns=1)[0]
    low, high = _span(np.append(measured, [offset.min(), offset.max()]), centred=True, least=_LEAST_SHIFT, tail=5)
    axes.imshow(offset, cmap=cost_colours(), vmin=low, vmax=high)
    dots = axes.scatter(x, y, c=measured, s=8, cmap=cost_colours(), vmin=low, vmax=high, edgecolors="black", lw=0.2)
    label = "vertical offset, right minus left (px)"
    axes.figure.colorbar(dots, cax=axes.inset_axes((1.02, 0, 0.035, 1)), label=label)
    told = f"rows are shifted by {offset.min():+.2f} to {offset.max():+.2f} px" if offset.any() else "no row is shifted"
    axes.set_title(f"{len(measured)} places of the right view; {told}")


def _draw_matches(
    axes: Axes,
    view: NDArray[np.uint8],
    step: int,
    matches: dict[str, NDArray[np.float32]],
    name: str,
    colours: Colormap,
) -> None:
    extent = (-0.5, view.shape[1] * step - 0.5, view.shape[0] * step - 0.5, -0.5)
    axes.imshow(view // 2 + 64, cmap="gray", vmin=0, vmax=255, extent=extent)
    values = matches[name]
    low, high = _span(values, centred=name == "vertical")
    dots = axes.scatter(matches["x"], matches["y"], c=values, s=6, cmap=colours, vmin=low, vmax=high)
    label = {"disparity": "disparity (px)", "vertical": "vertical offset, right minus left (px)"}[name]
    axes.figure.colorbar(dots, cax=axes.inset_axes((1.02, 0, 0.035, 1)), label=label)


def _span(
    values: NDArray[np.float32], centred: bool, least: float = _LEAST_SPAN, tail: float = 1
) -> tuple[float, float]:
    """Return the values of the first and last colour; ``tail`` % at each end may lie beyond."""
    low, high = np.percentile(values, (tail, 100 - tail)) if values.size else (0.0, 1.0)
    reach = max(least, abs(low), abs(high))
    return (-reach, reach) if centred else (float(low), float(high))
