"""Draw a calibration: how often pixels of a confidence are right, and the error and density at each threshold."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semidense.pipeline.figures.colours import BLUE, ORANGE, QUIET
from semidense.stages.evaluation.calibration.declaration import MAPS
from semidense.stages.evaluation.calibration.table import EDGES, Table, choices, probability

_WIDER = 20
"""Bins of the table in one point of the diagram."""
_FEWEST = 50
"""Pixels that a point must stand for."""
_MARKED = (0.5, 0.8, 0.9, 0.95, 0.99, 0.999)


def draw_calibration(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw the reliability in held-out scenes with the chosen map, and what R keeps and how much of it is wrong."""
    figure.set_size_inches(11, 5)
    table = Table.of({name: dataset[name].values for name in ("right", "wrong")})
    left, right = figure.subplots(1, 2)
    _draw_reliability(left, table, dataset)
    _draw_choices(right, table)


def _draw_reliability(axes: Axes, table: Table, dataset: xr.Dataset) -> None:
    pixels = (table.right + table.wrong).sum(axis=0).reshape(-1, _WIDER).sum(axis=1)
    parts = [share.reshape(-1, _WIDER).sum(axis=1) for share in table.shares]
    told = pixels >= _FEWEST
    share = parts[0][told] / (parts[0] + parts[1])[told]
    centres = EDGES.reshape(-1)[_WIDER // 2 :: _WIDER][: len(told)]
    scores = dataset["score"].values
    chosen = MAPS[int(np.argmin(scores))]
    axes.plot([0, 1], [0, 1], color=QUIET, linestyle="--", label="as sure as it should be")
    axes.plot(probability(centres[told]), share, color=BLUE, marker="o", label="held-out training scenes")
    axes.plot(probability(EDGES), probability(dataset["log_odds"].values), color=ORANGE, label=f"map: {chosen}")
    told_scores = ", ".join(f"{name} {score:.4f}" for name, score in zip(MAPS, scores, strict=True))
    axes.set(
        xlabel=f"confidence (0 to 1)\nBrier score: {told_scores}", ylabel="right (0 to 1)", xlim=(0, 1), ylim=(0, 1)
    )
    axes.legend(loc="upper left", frameon=False)
    axes.grid(alpha=0.3)


def _draw_choices(axes: Axes, table: Table) -> None:
    found = choices(table)
    axes.plot([100 * each.kept for each in found], [100 * each.error for each in found], color=BLUE)
    for R in _MARKED:
        near = next((each for each in found if each.R >= R), None)
        if near:
            place = 100 * near.kept, 100 * near.error
            axes.plot(*place, color=BLUE, marker="o")
            axes.annotate(f"R = {R:g}", place, xytext=(-8, 4), textcoords="offset points", ha="right")
    scenes = f"mean of {len(table.right)} scenes"
    axes.set(xlabel=f"kept (% of the pixels), {scenes}", ylabel=f"wrong (% of the kept), {scenes}", xlim=(0, 100))
    axes.set_yscale("symlog", linthresh=0.1)
    axes.set_ylim(bottom=0)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.grid(alpha=0.3)
