"""Print a comparison: one table an experiment, then the paper's figures."""

from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from semidense.pipeline.comparison.experiments import Comparison
from semidense.pipeline.comparison.paper_figures import QUOTED
from semidense.pipeline.comparison.rows import Row
from semidense.pipeline.results.metric_rows import FIGURES, MASK, THRESHOLD, over_scenes
from semidense.pipeline.results.text import print_table, results

TITLES = {
    "raw": "Raw maps: wrong or unreported pixels, %",
    "auc": "Confidence of the raw map: area under the error curve; lower is better",
}
_DENSITY = ("invalid", "bad", "bad_dual_cnn", "avgerr", "rms", "A50", "A90", "A95", "A99")
_SPARE = tuple(FIGURES[name].head for name in ("A50", "A90", "A95", "avgerr", "A99", "rms"))
"""Columns of semi-dense maps that a narrow terminal does without, the least important first."""


def quoted(found: Comparison) -> list[Row]:
    """Return the paper's figures for the experiments that were run."""
    run = {row["experiment"] for row in found.rows}
    return [row for row in QUOTED if row["experiment"] in run]


def at(rows: Iterable[Row], threshold: float) -> list[Row]:
    """Return the rows at a threshold and the mask of tables and figures."""
    return [row for row in rows if row["mask"] == MASK and row["threshold_px"] == threshold]


def of(rows: Iterable[Row], experiment: str) -> list[Row]:
    """Return the rows of an experiment."""
    return [row for row in rows if row["experiment"] == experiment]


def print_comparison(found: Comparison, masks: Iterable[str], threshold: float = THRESHOLD) -> None:
    """Print one table an experiment, the paper's figures, and the reason for each method that was not run.

    Args:
        found: the comparison.
        masks: where the non-occlusion masks of the scenes come from.
        threshold: error above which a pixel is wrong, one of ``THRESHOLDS``, px.
    """
    console = results()
    rows, means = at(found.rows, threshold), at(found.means, threshold)
    for experiment, figure in (("raw", "raw_bad"), ("auc", "auc")):
        if of(rows, experiment):
            table = _by_scene(of(rows, experiment), of(means, experiment), experiment, figure)
            print_table(table, console)
            console.print()
    if of(rows, "density"):
        print_table(_density_table(of(means, "density")), console, _SPARE)
        console.print()
    _print_quoted(console, quoted(found))
    kinds = ", ".join(sorted(set(masks)))
    console.print()
    text = f"mask: {MASK} ({kinds}); wrong: off by more than {threshold:g} px of the image at hand"
    console.print(text, style="dim", highlight=False)
    for reason in dict.fromkeys(each["why"] for each in found.unavailable):
        methods = ", ".join(each["method"] for each in found.unavailable if each["why"] == reason)
        console.print(f"not run: {methods}: {reason}", style="dim", highlight=False, markup=False)


def _by_scene(rows: Sequence[Row], means: Sequence[Row], experiment: str, figure: str) -> Table:
    """Return a table of scenes and methods; the more numerous of the two are the rows.

    Where the scenes are columns, the mean is the first: a narrow terminal shows it before it breaks the table in parts.
    """
    methods = {row["method"]: (row["method"], figure) for row in means}
    if experiment == "auc":
        methods["optimal"] = (means[0]["method"], "auc_optimal")
    cells = {(row["scene"], row["method"]): row for row in rows} | {("mean", row["method"]): row for row in means}
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    shown = {
        (scene, name): _cell(cells.get((scene, method), {}), value)
        for scene in (*scenes, "mean")
        for name, (method, value) in methods.items()
    }
    if len(methods) <= len(scenes):
        table = _table(TITLES[experiment], "scene", *methods)
        for scene in (*scenes, "mean"):
            table.add_row(escape(scene), *(shown[scene, name] for name in methods))
    else:
        table = _table(TITLES[experiment], "method", "mean", *scenes)
        for name in methods:
            table.add_row(escape(name), *(shown[scene, name] for scene in ("mean", *scenes)))
    return table


def _density_table(means: Sequence[Row]) -> Table:
    """Return a table of semi-dense maps: mean figures over the scenes."""
    title = f"Semi-dense maps, {over_scenes(means[0])}"
    table = _table(title, "method", "R", *(FIGURES[name].head for name in _DENSITY))
    for row in means:
        threshold = f"{row['R']:g}" if "R" in row else "-"
        table.add_row(escape(row["method"]), threshold, *(_cell(row, name) for name in _DENSITY))
    return table


def _print_quoted(console: Console, quoted: Sequence[Row]) -> None:
    """Print the paper's figures, those of the same data together."""
    console.print("Quoted from the paper: other data, another resolution", style="italic")
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in quoted:
        (figure,) = (name for name in FIGURES if name in row)
        groups.setdefault((figure, row["data"]), []).append(row)
    for (figure, data), rows in groups.items():
        values = ", ".join(f"{row['method']} {_cell(row, figure)}" for row in rows)
        console.print(f"{FIGURES[figure].head}, {data}:", style="dim", markup=False)
        console.print(f"  {values}", markup=False)


def _table(title: str, *columns: str) -> Table:
    table = Table(*(escape(column) for column in columns), title=title, box=None, pad_edge=False)
    for column in table.columns[1:]:
        column.justify = "right"
    return table


def _cell(row: Row, figure: str) -> str:
    return FIGURES[figure].text(row.get(figure))
