"""Draw error against invalid pixels: the two as the threshold on the confidence grows."""

from collections.abc import Callable, Iterable, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semidense.pipeline.figures.colours import LINES
from semidense.pipeline.figures.drawing import new_figure
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.results.metric_rows import Row, mean_name, mean_rows

Curve = dict[float, tuple[float, float]]
"""R -> (invalid, bad), both in percent."""
_MARKED = 5
"""Values of R that are written beside a curve, at most."""
_DASHES = ("-", "--", ":", "-.")
_MARKERS = "sD^vPX*"


def error_curve_figure(
    rows: Iterable[Row],
    *,
    title: str = "Error versus invalid pixels",
    mask: str = "nonocc",
    threshold: float = 1.0,
    others: Sequence[Row] = (),
) -> Figure:
    """Return the curve of error against invalid pixels as R grows, a line a scene, and their mean.

    Args:
        rows: metrics rows as promised to scripts; those of another mask or threshold, without R or with nothing
            reported (no ``bad``) are passed over.
        title: of the figure; no mathematics is parsed in it.
        mask: ``nonocc`` or ``all``.
        threshold: px, error above which a pixel is wrong.
        others: a row a matcher that becomes a point, with ``method``, ``invalid`` and ``bad`` over the same scenes.

    Returns:
        A figure: x is the percentage of invalid pixels, y the percentage of wrong ones among the reported. The
        mean is drawn where every scene of it reports something; some values of R are written beside it.

    Raises:
        UsageError: if no row is left.
    """
    chosen = [row for row in rows if row["mask"] == mask and row["threshold_px"] == threshold and "R" in row]
    curves = _by(chosen, lambda row: _named(str(row["scene"]), row))
    drawn = {name: points for name, of in curves.items() if (points := _points(of))}
    if not drawn:
        raise UsageError(f"no row has an R, the mask {mask} and the threshold {threshold:g} px: nothing to draw")
    figure = new_figure(title)
    figure.set_size_inches(9.5, 6)
    axes = figure.subplots()
    styles = cycle([(colour, dash) for dash in _DASHES for colour in LINES])
    for name, curve in drawn.items():
        colour, dash = next(styles)
        _draw(axes, curve, name, color=colour, linestyle=dash, linewidth=1.2, marker=".")
    _draw_means(axes, chosen)
    draw_matchers(axes, others)
    _label(axes, mask, threshold)
    return figure


def _by(rows: Iterable[Row], name: Callable[[Row], str]) -> dict[str, list[Row]]:
    """Return the rows in groups, by name."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(name(row), []).append(row)
    return groups


def _points(rows: Iterable[Row]) -> Curve:
    """Return the points of a curve in the order of R; where nothing is reported there is none."""
    known = {float(row["R"]): row for row in rows if "bad" in row}
    return {R: (float(row["invalid"]), float(row["bad"])) for R, row in sorted(known.items())}


def _family(row: Row) -> str:
    """Return the settings of a row's variant other than R; empty without any."""
    settings = str(row.get("variant", "")).split(", ")
    return ", ".join(setting for setting in settings if not setting.startswith("semidense.R="))


def _named(what: str, row: Row) -> str:
    return f"{what}, {family}" if (family := _family(row)) else what


def _draw_means(axes: Axes, rows: Iterable[Row]) -> None:
    """Draw the mean of each family of several scenes, and write R beside it, or beside a family's only curve."""
    for dash, family in zip(cycle(_DASHES), _by(rows, _family).values(), strict=False):
        scenes = len({row["scene"] for row in family})
        over = mean_name(scenes)
        mean = _points(row for row in mean_rows(family) if row["scene"] == over)
        if scenes > 1 and mean:
            style = {"color": "black", "linestyle": dash, "linewidth": 2.6, "marker": "o", "markersize": 4}
            _draw(axes, mean, _named(f"{over} scenes", family[0]), **style)
        _write_thresholds(axes, mean)


def _draw(axes: Axes, curve: Curve, label: str, **style: Any) -> None:  # noqa: ANN401
    invalid, bad = zip(*curve.values(), strict=True)
    (line,) = axes.plot(invalid, bad, **style)
    line.set_label(label)


def _write_thresholds(axes: Axes, curve: Curve) -> None:
    """Write a few values of R beside a curve, the first and the last among them."""
    thresholds = list(curve)
    for index in np.unique(np.linspace(0, len(thresholds) - 1, min(_MARKED, len(thresholds))).round().astype(int)):
        R = thresholds[index]
        place: dict[str, Any] = {
            "xytext": (6, 8),
            "textcoords": "offset points",
            "fontsize": "small",
            "fontweight": "bold",
        }
        box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
        axes.annotate(f"R = {R:g}", curve[R], bbox=box, zorder=5, **place)


def draw_matchers(axes: Axes, means: Iterable[Row]) -> None:
    """Draw a point a matcher: ``method``, ``invalid`` and ``bad`` of each row, in percent."""
    for row, marker, colour in zip(means, cycle(_MARKERS), cycle(LINES[1:]), strict=False):
        style: dict[str, Any] = {
            "color": colour,
            "markeredgecolor": "black",
            "markersize": 8.5,
            "linestyle": "none",
            "zorder": 6,
        }
        axes.plot(row["invalid"], row["bad"], marker, label=row["method"], **style)


def _label(axes: Axes, mask: str, threshold: float) -> None:
    axes.set_xlabel(f"invalid: {mask} pixels without a disparity (%)")
    axes.set_ylabel(f"bad: reported {mask} pixels off by more than {threshold:g} px (%)")
    axes.set_ylim(bottom=0)
    axes.margins(x=0.12)
    axes.set_xlim(left=-1)
    axes.grid(alpha=0.3)
    legend = axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1), frameon=False, fontsize="small")
    for text in legend.get_texts():
        text.set_parse_math(False)
