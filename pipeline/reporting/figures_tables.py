"""The tables of figures: errors and densities, and how well the confidence ranks pixels."""

from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.console import mean_rows
from pipeline.markup import Html, folded, table

THRESHOLD_PX = 1.0
"""The error of the tables and curves that stand first, px of the image at hand."""
_Row = Mapping[str, Any]
_COLUMNS = {
    "pixels": ("pixels", "{:,.0f}"),
    "raw_bad": ("raw error (%)", "{:.1f}"),
    "bad": ("error of kept (%)", "{:.1f}"),
    "invalid": ("not kept (%)", "{:.1f}"),
    "avgerr": ("mean error of kept (px)", "{:.2f}"),
    "rms": ("rms of kept (px)", "{:.2f}"),
}


def metrics_tables(rows: Sequence[_Row], R: float) -> Html:
    """Return the table at the first threshold, and folded those at all thresholds and masks."""
    first = [row for row in rows if row["mask"] == "nonocc" and row["threshold_px"] == THRESHOLD_PX]
    caption = f"Errors above {THRESHOLD_PX:g} px, mask nonocc, R = {R:g}"
    every = [[row["scene"], row["mask"], f"{row['threshold_px']:g}", *_cells(row)] for row in [*rows, *mean_rows(rows)]]
    head = [title for title, _ in _COLUMNS.values()]
    more = table(["scene", "mask", "threshold (px)", *head], every, caption="All thresholds and masks", words=2)
    return _table(first, ["scene", *head], lambda row: _cells(row), caption) + folded("All thresholds and masks", more)


def _cells(row: _Row) -> list[str]:
    return [form.format(row[name]) if name in row else "-" for name, (_, form) in _COLUMNS.items()]


def _table(rows: Sequence[_Row], head: Sequence[str], cells: Any, caption: str) -> Html:  # noqa: ANN401
    every = [*rows, *mean_rows(rows)]
    return table(head, [[row["scene"], *cells(row)] for row in every], caption=caption)


def auc_table(rows: Sequence[_Row]) -> Html:
    """Return the area under the error curve of the confidence beside what a perfect one would reach."""
    chosen = [row for row in rows if row["mask"] == "nonocc" and row["threshold_px"] == THRESHOLD_PX and "auc" in row]
    return _table(
        chosen,
        ["scene", "AUC", "optimal AUC", "AUC / optimal"],
        _areas,
        f"How well the confidence ranks pixels: area under the error curve, errors above {THRESHOLD_PX:g} px, nonocc",
    )


def _areas(row: _Row) -> list[str]:
    best = row.get("auc_optimal", 0)
    return [f"{row['auc']:.4f}", f"{best:.4f}", f"{row['auc'] / best:.1f}" if best else "-"]
