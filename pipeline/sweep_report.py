"""What a sweep leaves: a table, a CSV and the curve of error against invalid pixels."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.console import mean_rows, print_metrics
from pipeline.exporter import writable_folder, write_rows
from pipeline.views.figures import error_curve_figure, save_png

THRESHOLD_PX = 1.0
"""The threshold of the table and of the curve, px; the CSV has all."""


def write_sweep(rows: Sequence[Mapping[str, Any]], folder: Path) -> list[Path]:
    """Write ``sweep.csv`` with every row and ``sweep.png`` with the curve; return their paths.

    Where no threshold keeps a pixel, or another wish than R decides, there is no curve, and no picture.

    Raises:
        UsageError: if the folder cannot be written.
    """
    writable_folder(folder)
    table, picture = folder / "sweep.csv", folder / "sweep.png"
    write_rows(rows, table)
    picture.unlink(missing_ok=True)
    if not any("bad" in row and "R" in row for row in rows):
        return [table]
    save_png(error_curve_figure(rows, threshold=THRESHOLD_PX), picture)
    return [table, picture]


def print_sweep(rows: Sequence[Mapping[str, Any]], masks: Mapping[str, str]) -> None:
    """Print error and density for each R: the mean over scenes, or the scene if there is one."""
    chosen = [row for row in rows if row["mask"] == "nonocc" and row["threshold_px"] == THRESHOLD_PX]
    print_metrics(mean_rows(chosen) or chosen, masks)
