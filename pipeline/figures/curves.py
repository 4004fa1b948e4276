"""Draw error against invalid pixels: the two as the threshold on the confidence grows."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semidense.pipeline.figures.colours import LINES
from semidense.pipeline.figures.drawing import new_figure
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.results.metric_rows import Row, mean_name, mean_rows, without_chance

Curve = dict[float, tuple[float, float]]
"""R -> (invalid, bad), both in percent."""
_MARKED = 5
"""Values of R that are written beside a curve, at most."""
_DOTS = 25
"""Points of a curve that are drawn as dots, at most: more make a band."""
_WIDTH, _HEIGHT, _LINE = 6.2, 5.4, 0.19
"""Width of the figure, its height without the legend, and the height of a line of the legend, inches."""
_COLUMNS = 64
"""Characters in a line of the legend."""
_DASHES = ("-", "--", ":", "-.")
_MARKERS = "sD^vPX*"
_SHAPES = "o" + _MARKERS
"""Shapes of the dots of each family: each set of settings other than R."""


def error_curve_figure(
    rows: Iterable[Row],
    *,
    title: str = "Error versus invalid pixels",
    mask: str = "nonocc",
    threshold: float = 1.0,
    others: Sequence[Row] = (),
    marked: Sequence[float] | None = None,
) -> Figure:
    """Return the curve of error against invalid pixels as R grows, a line a scene, and their mean.

    Args:
        rows: metrics rows as promised to scripts; those of another mask or threshold, without R or with nothing
            reported (no ``bad``) are passed over.
        title: of the figure; no mathematics is parsed in it.
        mask: ``nonocc`` or ``all``.
        threshold: px, error above which a pixel is wrong.
        others: a row a matcher that becomes a point, with ``method``, ``invalid`` and ``bad`` over the same scenes.
        marked: values of R that are dots on the curve of each family of settings, and are written beside the first
            one; None takes a few that are spread evenly.

    Returns:
        A figure: x is the percentage of invalid pixels, y the percentage of wrong ones among the reported. The
        mean is drawn where every scene of it reports something; some values of R are written beside it. A curve ends
        where a scene reports fewer than one pixel in a hundred: the error of a handful of pixels is chance. If all
        rows have the same R, it stands in the title, each curve is one dot, and the axes show the dots' surroundings.

    Raises:
        UsageError: if no row is left.
    """
    chosen = [row for row in rows if row["mask"] == mask and row["threshold_px"] == threshold and "R" in row]
    chosen = without_chance(chosen)
    curves = _by(chosen, lambda row: _named(str(row["scene"]), row))
    drawn = {name: points for name, of in curves.items() if (points := _points(of))}
    if not drawn:
        raise UsageError(f"no row has an R, the mask {mask} and the threshold {threshold:g} px: nothing to draw")
    values = {R for curve in drawn.values() for R in curve}
    lone = values.pop() if len(values) == 1 else None
    figure = new_figure(title if lone is None else f"{title}, R = {lone:g}")
    axes = figure.subplots()
    if lone is None:
        _draw_means(axes, chosen, marked, _draw_curves(axes, drawn))
    else:
        _draw_dots(axes, chosen)
    draw_matchers(axes, [{**row, "method": f"{row['method']} (other matcher)"} for row in others])
    _label(axes, mask, threshold, from_zero=lone is None)
    figure.set_size_inches(_WIDTH, _HEIGHT + _LINE * _legend(figure, axes))
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


def _draw_curves(axes: Axes, curves: Mapping[str, Curve]) -> dict[str, str]:
    """Draw a line a curve; return their colours by name."""
    styles = cycle([(colour, dash) for dash in _DASHES for colour in LINES])
    colours: dict[str, str] = {}
    for name, curve in curves.items():
        colours[name], dash = next(styles)
        dots = "." if len(curve) <= _DOTS else None
        _draw(axes, curve, name, color=colours[name], linestyle=dash, linewidth=1.4, marker=dots)
    return colours


def _draw_means(axes: Axes, rows: Iterable[Row], marked: Sequence[float] | None, colours: Mapping[str, str]) -> None:
    """Draw the mean of each family of several scenes, and dots at some R on it, or on a family's only curve.

    R is written beside the dots of the first family; those of the others have another shape.
    """
    told = True
    for dash, shape, family in zip(cycle(_DASHES), cycle(_SHAPES), _by(rows, _family).values(), strict=False):
        over, mean = _mean_curve(family)
        colour = colours.get(_named(str(family[0]["scene"]), family[0])) if over is None else "black"
        if over and mean:
            _draw(axes, mean, over, color=colour, linestyle=dash, linewidth=2.6)
        thresholds = _spread(mean) if marked is None else [R for R in marked if R in mean]
        for R in thresholds:
            axes.scatter(*mean[R], color=colour, marker=shape, edgecolor="black", linewidth=0.6, s=30, zorder=6)
            if told:
                _write_threshold(axes, mean[R], R)
        told = told and not thresholds


def _draw_dots(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw rows of one R: a shape a family, a colour a scene, and the mean of several in black."""
    several = len({row["scene"] for row in rows}) > 1
    colours = dict(zip(dict.fromkeys(row["scene"] if several else _family(row) for row in rows), cycle(LINES)))
    for shape, (name, family) in zip(cycle(_SHAPES), _by(rows, _family).items(), strict=False):
        style = {"linestyle": "none", "marker": shape, "markeredgecolor": "black"}
        for row in family:
            colour = colours[row["scene"] if several else name]
            _draw(axes, _points([row]), _named(str(row["scene"]), row), color=colour, markersize=7, **style)
        over, mean = _mean_curve(family)
        if over:
            _draw(axes, mean, over, color="black", markersize=10, **style)


def _mean_curve(family: Sequence[Row]) -> tuple[str | None, Curve]:
    """Return the name of a family's mean over several scenes, None of one scene, and its points."""
    scenes = len({row["scene"] for row in family})
    mean = _points(row for row in mean_rows(family) if row["scene"] == mean_name(scenes))
    return _named(f"{mean_name(scenes)} scenes", family[0]) if scenes > 1 else None, mean


def _draw(axes: Axes, curve: Curve, label: str, **style: Any) -> None:  # noqa: ANN401
    """Draw a curve under its name; one without a point is left out."""
    if curve:
        (line,) = axes.plot(*zip(*curve.values(), strict=True), **style)
        line.set_label(label)


def _spread(curve: Curve) -> list[float]:
    """Return a few values of R, the first and the last among them."""
    thresholds = list(curve)
    places = np.linspace(0, len(thresholds) - 1, min(_MARKED, len(thresholds)))
    return [thresholds[index] for index in np.unique(places.round().astype(int))]


def _write_threshold(axes: Axes, point: tuple[float, float], R: float) -> None:
    """Write R beside a dot: to the left of it in the right half of the axes."""
    box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
    at_left = point[0] > 50
    style: dict[str, Any] = {"textcoords": "offset points", "fontsize": "small", "fontweight": "bold"}
    style |= {"xytext": (-6 if at_left else 6, 8), "ha": "right" if at_left else "left"}
    axes.annotate(f"R = {R:g}", point, bbox=box, zorder=5, **style)


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


def _label(axes: Axes, mask: str, threshold: float, *, from_zero: bool) -> None:
    axes.set_xlabel(f"invalid: {mask} pixels that are not kept (%)")
    axes.set_ylabel(f"bad: kept {mask} pixels off by more than {threshold:g} px (%)")
    if from_zero:
        axes.margins(x=0.04, y=0.1)  # room for what is written beside the curve
        axes.set_ylim(bottom=0)
        axes.set_xlim(left=-1)
    else:
        axes.margins(0.15)
    axes.grid(alpha=0.3)


def _legend(figure: Figure, axes: Axes) -> int:
    """Put the legend below the axes, and return its lines. It has as many columns as fit; names are taken literally."""
    handles, labels = axes.get_legend_handles_labels()
    columns = max(1, min(4, _COLUMNS // (max(map(len, labels)) + 6)))
    place: dict[str, Any] = {"loc": "outside lower center", "ncols": columns, "frameon": False, "fontsize": "small"}
    for text in figure.legend(handles, labels, **place).get_texts():
        text.set_parse_math(False)
    return -(-len(labels) // columns)
