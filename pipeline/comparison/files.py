"""Write the files of a comparison: ``comparison.csv``, ``comparison.json``, and figures."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from semidense.datasets.formats.atomic import atomic_write
from semidense.pipeline.comparison.experiments import Comparison
from semidense.pipeline.comparison.figures import density_figure, dots_figure, sheets
from semidense.pipeline.comparison.tables import TITLES, at, of, quoted
from semidense.pipeline.files.publishing import publishing, require_place
from semidense.pipeline.files.writing import explaining, save_png, table_text
from semidense.pipeline.results.metric_rows import FIGURES, THRESHOLD

COLUMNS = ("experiment", "scene", "method", "mask", "threshold_px", "R", *FIGURES, "quoted", "data")
"""The columns of ``comparison.csv``."""
_RECORD = "comparison.json"
_TABLES = ("comparison.csv", _RECORD)
_PICTURES = ("raw.png", "auc.png", "density.png", "lighting.png", "texture.png")
"""The figures, of which a comparison writes those of its experiments."""


def as_json(found: Comparison, files: Iterable[Path] = ()) -> dict[str, Any]:
    """Return a comparison as one object for scripts.

    Returns:
        ``rows`` and ``means`` in the form of metrics rows with their ``experiment``; ``quoted``: the paper's figures,
        each with its ``data``; ``unavailable``: ``method`` and ``why``; ``notes``; ``files``.
    """
    return {
        "rows": found.rows,
        "means": found.means,
        "quoted": quoted(found),
        "unavailable": found.unavailable,
        "notes": list(found.notes),
        "files": [str(file) for file in files],
    }


def require_comparison_place(folder: Path, experiments: Iterable[str]) -> None:
    """Refuse a folder for a comparison before it is made; see ``publishing.require_place``."""
    require_place(folder, _RECORD, {*_TABLES, *(f"{experiment}.png" for experiment in experiments)})


def write_comparison(found: Comparison, folder: Path, threshold: float = THRESHOLD) -> list[Path]:
    """Write ``comparison.csv``, ``comparison.json`` and the figures; return their paths.

    Figures of an earlier comparison in this folder that this one does not draw are deleted.

    Args:
        found: the comparison.
        folder: where to.
        threshold: of the figures, one of ``THRESHOLDS``, px; the other files have all.

    Raises:
        UsageError: if the folder cannot be written, or holds a file of these names that no earlier comparison wrote.
    """
    figures = _figures(found, threshold)
    names = [*_TABLES, *figures]
    with publishing(folder, _RECORD, obsolete=_PICTURES) as draft:
        for name, drawn in figures.items():
            save_png(drawn, draft / name)
        _write(draft / "comparison.csv", table_text([*found.rows, *found.means, *quoted(found)], COLUMNS))
        document = as_json(found) | {"files": names}
        _write(draft / "comparison.json", json.dumps(document, allow_nan=False, indent=1))
    return [folder / name for name in names]


def _write(path: Path, text: str) -> None:
    with explaining(path), atomic_write(path) as file:
        file.write(text.encode())


def _figures(found: Comparison, threshold: float) -> dict[str, Any]:
    """Return the figures by file name: a figure an experiment that was run, and the sheets."""
    rows = at(found.rows, threshold)
    figures = {
        f"{experiment}.png": dots_figure(of(rows, experiment), figure, title=TITLES[experiment])
        for experiment, figure in (("raw", "raw_bad"), ("auc", "auc"))
        if of(rows, experiment)
    }
    if of(rows, "density"):
        figures["density.png"] = density_figure(at(found.means, threshold))
    return figures | sheets(found)
