"""Draw the figures of a scene as a table."""

import xarray as xr
from matplotlib.figure import Figure
from matplotlib.table import Table
from matplotlib.transforms import Bbox

from semidense.pipeline.results.metric_rows import FIGURES
from semidense.stages.metrics.errors import MASKS

_NOTE = (
    "raw bad: wrong or missing pixels before filtering; bad: wrong ones among the reported; invalid: not reported.\n"
    "nonocc: pixels that both views see; all: also those hidden in the right view; both only where the truth is known."
)


def draw_metrics(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw the product ``metrics`` or ``ranking``: a row a mask and threshold, a column a figure with its unit."""
    names = [name for name in FIGURES if name in dataset]
    head = ["mask", "threshold\n(px)", *(FIGURES[name].head.replace(" ", "\n") for name in names)]
    rows = [
        [mask, f"{threshold:g}", *(FIGURES[name].text(float(dataset[name].values[m, t])) for name in names)]
        for m, mask in enumerate(MASKS)
        for t, threshold in enumerate(dataset["threshold"].values)
    ]
    figure.set_size_inches(1.05 * len(head), 0.32 * len(rows) + 2)
    axes = figure.subplots()
    axes.set_axis_off()
    table = axes.table(rows, colLabels=head, cellLoc="right", bbox=Bbox.unit())
    _style(table)
    figure.supxlabel(_NOTE, fontsize="small", color="#404040")


def _style(table: Table) -> None:
    """Colour the head and every other row, in place of lines."""
    table.auto_set_font_size(False)
    for (row, _), cell in table.get_celld().items():
        cell.set(linewidth=0, facecolor="#F2F2F2" if row % 2 else "white")
        cell.get_text().set_fontsize(9)
        if row == 0:
            cell.set(height=2 * cell.get_height(), facecolor="#D8E6F0")
            cell.get_text().set(fontweight="bold", fontsize=8.5)
