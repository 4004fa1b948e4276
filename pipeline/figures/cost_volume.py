"""The figure of a cost volume: the costs of all pixels at one disparity, and of one pixel at all disparities.

A volume may be far larger than memory: one disparity, one pixel and a few rows of it are read, never the whole.
"""

import math
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from semidense.pipeline.figures.colours import BLUE, GREEN, ORANGE, RED, cost_colours
from semidense.pipeline.figures.drawing import Scale, draw_map, image_panels, legend_below, none_patch
from semidense.pipeline.plan.errors import UsageError
from semidense.stages.disparity.winner_takes_all import winner_take_all

_TICKS = (0.5, 0.01, 0.99, 0.1, 0.9, 1e-4, 0.9999, 1e-6, 0.999999, 1e-8, 0.99999999)
"""Probabilities to mark on an axis of log-odds, the most important first."""
_HALO = withStroke(linewidth=5, foreground="white")
_CURVE_HEIGHT = 3.5
"""Height that the curve needs beside a very wide image, inches."""
_ROWS = 32
"""Rows in the middle of the image whose winners decide which disparity is drawn by default."""


def draw_costs(
    figure: Figure,
    dataset: xr.Dataset,
    pixel: tuple[int, int] | None = None,
    disparity: int | None = None,
    truth: xr.Dataset | None = None,
) -> None:
    """Draw a slice of the volume and the cost curve of a pixel, which is marked on the slice.

    Args:
        figure: an empty one.
        dataset: the product ``costvolume``.
        pixel: row and column; None for the pixel nearest to the centre that has a valid cost.
        disparity: px; None for the median of the cheapest disparities in the middle rows.
        truth: the product ``truth`` of the scene; where it is known at the pixel, it is marked on the curve.

    Raises:
        UsageError: if the pixel or the disparity lies outside the volume.
    """
    disparities = dataset["d"].values.astype(int)
    y, x = _pixel(dataset["cost"], pixel)
    index = _index(dataset["cost"], disparities, disparity)
    costs = dataset["cost"].isel(d=index).values.astype(np.float32)
    left, right = image_panels(figure, costs.shape, columns=2, least_height=_CURVE_HEIGHT)[0]
    _draw_slice(left, costs, int(disparities[index]))
    left.plot(x, y, "o", markersize=10, markerfacecolor="none", markeredgecolor="black", path_effects=[_HALO])
    curve = dataset["cost"].isel(y=y, x=x).values.astype(np.float32)
    draw_curve(right, disparities, curve)
    right.axvline(disparities[index], color="#606060", linestyle="--", zorder=0, label="the disparity of the slice")
    if truth is not None:
        _mark_truth(right, float(truth["disparity"].isel(y=y, x=x)))
    right.set_title(f"costs of the pixel y = {y}, x = {x} (ring)")
    handles, _ = right.get_legend_handles_labels()
    legend_below(figure, [*handles, none_patch(costs, "no cost: not judged, or right pixel outside the image")])


def _pixel(cost: xr.DataArray, pixel: tuple[int, int] | None) -> tuple[int, int]:
    """Return the pixel asked for, or in the middle row the one nearest to the centre with a valid cost."""
    height, width = cost.sizes["y"], cost.sizes["x"]
    if pixel is None:
        y = height // 2
        valid = np.flatnonzero(np.isfinite(cost.isel(y=y).values).any(axis=-1))
        return y, int(min(valid, key=lambda x: abs(x - width // 2), default=width // 2))
    y, x = pixel
    if not (0 <= y < height and 0 <= x < width):
        raise UsageError(f"pixel y = {y}, x = {x}: the image has rows 0 to {height - 1} and columns 0 to {width - 1}")
    return y, x


def _index(cost: xr.DataArray, disparities: NDArray[np.int_], disparity: int | None) -> int:
    """Return the place of a disparity in the volume; None: of the median of the winners in the middle rows."""
    if disparity is None:
        first = max(0, (cost.sizes["y"] - _ROWS) // 2)
        winners = winner_take_all(cost.isel(y=slice(first, first + _ROWS)).values, int(disparities[0]))
        known = winners[np.isfinite(winners)]
        disparity = int(np.median(known)) if known.size else int(disparities[0])
    if not disparities[0] <= disparity <= disparities[-1]:
        raise UsageError(f"disparity {disparity} px: the volume has {disparities[0]} to {disparities[-1]} px")
    return int(disparity - disparities[0])


def _draw_slice(axes: Axes, costs: NDArray[np.float32], disparity: int) -> None:
    known = np.abs(costs[np.isfinite(costs)])
    reach = float(np.percentile(known, 99)) if known.size else 1.0
    scale = Scale(cost_colours(), -max(reach, 1e-3), max(reach, 1e-3), "cost (log-odds)")
    draw_map(axes, costs, scale)
    axes.set_title(f"costs at the disparity {disparity} px (below 0: rather a match)")


def draw_curve(axes: Axes, disparities: NDArray[np.int_], costs: NDArray[np.float32]) -> None:
    """Draw the costs of one pixel over the disparities, with the winner and the runner-up marked.

    Args:
        axes: an empty one; a second axis of probabilities is put on its right.
        disparities: (d,) px.
        costs: (d,) log-odds of a mismatch, NaN invalid.
    """
    axes.plot(disparities, costs, color=BLUE, marker=".", linewidth=1.2, label="cost")
    marks = zip(local_minima(costs)[:2], ("winner", "runner-up minimum"), ("*", "v"), (RED, ORANGE), strict=False)
    for index, name, marker, colour in marks:
        label = f"{name}: {disparities[index]} px, cost {costs[index]:.2f}, probability {_probability(costs[index])}"
        style: dict[str, Any] = {"markersize": 13, "markeredgecolor": "black", "linestyle": "none"}
        axes.plot(disparities[index], costs[index], marker=marker, color=colour, label=label, **style)
    _shade_invalid(axes, disparities, costs)
    axes.set(xlabel="disparity (px)", ylabel="cost: log-odds of a mismatch", aspect="auto")
    axes.set_xlim(disparities[0] - 0.5, disparities[-1] + 0.5)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(alpha=0.3)
    _probability_axis(axes)


def _mark_truth(axes: Axes, disparity: float) -> None:
    if np.isfinite(disparity):
        axes.axvline(disparity, color=GREEN, linestyle="-.", zorder=0, label=f"truth: {disparity:.4g} px")


def _shade_invalid(axes: Axes, disparities: NDArray[np.int_], costs: NDArray[np.float32]) -> None:
    label = "no cost at this disparity"
    for disparity in disparities[~np.isfinite(costs)]:
        axes.axvspan(disparity - 0.5, disparity + 0.5, color="#E4E4E4", linewidth=0, zorder=0, label=label)
        label = "_"


def local_minima(costs: NDArray[np.float32]) -> list[int]:
    """Return where costs have local minima, the lowest first; of equal ones the smallest index first.

    A minimum is a run of equal costs that is lower than both its neighbours; its first place counts. Beyond
    the ends and at an invalid cost everything is infinitely high.

    >>> local_minima(np.array([3, 1, 1, 2, 0, 5], np.float32))
    [4, 1]
    """
    height = np.where(np.isfinite(costs), costs, np.inf)
    starts = np.flatnonzero(np.r_[True, height[1:] != height[:-1]])
    levels = np.r_[np.inf, height[starts], np.inf]
    low = (levels[1:-1] < levels[:-2]) & (levels[1:-1] < levels[2:])
    return sorted(starts[low].tolist(), key=lambda index: height[index])


def expit(log_odds: float) -> float:
    """Return the probability of log-odds, ``1 / (1 + exp(-log_odds))``, without overflow.

    >>> expit(0.0)
    0.5
    """
    return float(0.5 * (1 + np.tanh(np.float64(log_odds) / 2)))


def _probability(log_odds: float) -> str:
    """Return the probability of log-odds to two digits, near 1 to two digits of what it lacks.

    >>> _probability(-5.4), _probability(5.4), _probability(20.0)
    ('0.0045', '0.9955', '1 - 2.1e-09')
    """
    lacks = expit(-log_odds)
    if lacks >= 0.5 or not lacks:
        return f"{expit(log_odds):.2g}"
    return f"{1 - lacks:.{1 - math.floor(math.log10(lacks))}f}" if lacks > 1e-6 else f"1 - {lacks:.2g}"


def _probability_axis(axes: Axes) -> None:
    """Put the probabilities of a mismatch beside the log-odds, as many as there is room for."""
    low, high = axes.get_ylim()
    twin = axes.twinx()
    twin.set_ylim(low, high)
    chosen: dict[float, str] = {}
    for probability in _TICKS:
        place = float(np.log(probability / (1 - probability)))
        if low <= place <= high and all(abs(place - other) > 0.06 * (high - low) for other in chosen):
            chosen[place] = f"{probability:.8g}"
    twin.set_yticks(list(chosen), list(chosen.values()))
    twin.set_ylabel("probability of a mismatch")
