"""Figures of a comparison: a dot a scene and method, and error against invalid pixels."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from pipeline.views.colours import BLUE, QUIET, RED
from pipeline.views.curves import draw_matchers
from pipeline.views.panels import new_figure

Row = Mapping[str, Any]
_UNITS = {"raw_bad": "wrong or unreported pixels (%)", "auc": "area under the error curve (1)"}
_MARKED = (0.0, 0.5, 0.9, 0.99)
"""Values of R that are written beside the curve."""


def dots_figure(rows: Sequence[Row], figure: str, *, title: str, width: float = 9.5) -> Figure:
    """Return a figure with a line a method: a dot a scene, and a bar at their mean.

    Args:
        rows: of one experiment, mask and threshold; the first method is drawn at the top. Where they have an
            ``auc_optimal``, its mean is drawn as a line across.
        figure: the key that is drawn.
        title: stands above.
        width: of the figure, inches.
    """
    methods = list(dict.fromkeys(row["method"] for row in rows))
    drawn = new_figure(title)
    drawn.set_size_inches(width, 1.8 + 0.45 * len(methods))
    axes = drawn.subplots()
    values = [[row[figure] for row in rows if row["method"] == method and figure in row] for method in methods]
    axes.barh(methods, [np.mean(each) for each in values], color=QUIET, label="mean")
    for method, each in zip(methods, values, strict=True):
        axes.plot(each, [method] * len(each), "o", color=BLUE, markersize=4, label="a scene")
    optimal = [row["auc_optimal"] for row in rows if "auc_optimal" in row and row["method"] == methods[0]]
    if optimal:
        axes.axvline(float(np.mean(optimal)), color=RED, linestyle="--", label="mean of the optimal area")
    axes.invert_yaxis()
    axes.set(xlabel=_UNITS[figure], xlim=(0, None))
    axes.grid(axis="x", alpha=0.3)
    handles, labels = axes.get_legend_handles_labels()
    drawn.legend(*_first_of_each(handles, labels), loc="outside lower center", ncols=3, frameon=False)
    return drawn


def _first_of_each(handles: Sequence[Any], labels: Sequence[str]) -> tuple[list[Any], list[str]]:
    first = dict(reversed(list(zip(labels, handles, strict=True))))
    return list(first.values()), list(first)


def density_figure(means: Sequence[Row]) -> Figure:
    """Return error against invalid pixels: our curve over R, a point each other matcher.

    Args:
        means: mean rows of one mask and threshold, of the experiments ``curve`` and ``density``.
    """
    drawn = new_figure("Error versus invalid pixels")
    drawn.set_size_inches(9.5, 6)
    axes = drawn.subplots()
    curve = [row for row in means if row["experiment"] == "curve" and "bad" in row]
    axes.plot([row["invalid"] for row in curve], [row["bad"] for row in curve], color=BLUE, linewidth=2)
    axes.lines[0].set_label("dual-cnn, over R")
    for row in curve:
        if row["R"] in _MARKED:
            place = row["invalid"], row["bad"]
            axes.plot(*place, ".", color=BLUE, markersize=9)
            axes.annotate(f"R = {row['R']:g}", place, xytext=(6, 6), textcoords="offset points", fontsize="small")
    others = [row for row in means if row["experiment"] == "density" and "bad" in row and "R" not in row]
    draw_matchers(axes, others)
    mask, threshold, scenes = means[0]["mask"], means[0]["threshold_px"], means[0]["scene"]
    axes.set_xlabel(f"invalid: {mask} pixels without a disparity (%), {scenes} scenes")
    axes.set_ylabel(f"bad: reported {mask} pixels off by more than {threshold:g} px (%)")
    axes.margins(x=0.12)
    axes.set_ylim(bottom=0)
    axes.set_xlim(left=0)
    axes.grid(alpha=0.3)
    axes.legend(loc="upper right", frameon=False)
    return drawn
