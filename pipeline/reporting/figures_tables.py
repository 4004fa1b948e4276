"""The tables of figures: errors and densities, and how well the confidence ranks pixels."""

from collections.abc import Sequence

from pipeline.comparison_rows import Row
from pipeline.comparison_rows import mean_rows as comparison_means
from pipeline.console import mean_rows
from pipeline.markup import Html, folded, table

THRESHOLD_PX = 1.0
"""The error of the tables and curves that stand first, px of the image at hand."""
_COLUMNS = {
    "pixels": ("pixels", "{:,.0f}"),
    "raw_bad": ("raw error (%)", "{:.1f}"),
    "bad": ("error of kept (%)", "{:.1f}"),
    "invalid": ("not kept (%)", "{:.1f}"),
    "avgerr": ("mean error of kept (px)", "{:.2f}"),
    "rms": ("rms of kept (px)", "{:.2f}"),
}


def metrics_tables(rows: Sequence[Row], R: float) -> Html:
    """Return the table at the first threshold, and folded those at all thresholds and masks."""
    caption = f"Errors above {THRESHOLD_PX:g} px, mask nonocc, R = {R:g}"
    every = [[row["scene"], row["mask"], f"{row['threshold_px']:g}", *_cells(row)] for row in _with_mean(rows)]
    head = [title for title, _ in _COLUMNS.values()]
    more = table(["scene", "mask", "threshold (px)", *head], every, caption="All thresholds and masks", words=2)
    first = [[row["scene"], *_cells(row)] for row in _with_mean(_chosen(rows))]
    return table(["scene", *head], first, caption=caption) + folded("All thresholds and masks", more)


def _chosen(rows: Sequence[Row]) -> list[Row]:
    """Return the rows of the mask and the threshold that stand first."""
    return [row for row in rows if row["mask"] == "nonocc" and row["threshold_px"] == THRESHOLD_PX]


def _with_mean(rows: Sequence[Row]) -> list[Row]:
    return [*rows, *mean_rows(rows)]


def _cells(row: Row) -> list[str]:
    return [form.format(row[name]) if name in row else "-" for name, (_, form) in _COLUMNS.items()]


def auc_table(rows: Sequence[Row], compared: Sequence[Row]) -> Html:
    """Return the area under the error curve of the confidence beside what a perfect one and other measures reach.

    Args:
        rows: metrics rows.
        compared: rows of the measures that are cached.
    """
    others = [row for row in _chosen(compared) if row["experiment"] == "auc"]
    methods = list(dict.fromkeys(row["method"] for row in others))
    areas = {(row["scene"], row["method"]): row["auc"] for row in [*others, *comparison_means(others)] if "auc" in row}
    every = _with_mean([row for row in _chosen(rows) if "auc" in row])
    cells = [
        [row["scene"], *_areas(row), *(_area(areas.get((row["scene"], method))) for method in methods)] for row in every
    ]
    caption = (
        f"How well a confidence ranks pixels: area under the error curve, errors above {THRESHOLD_PX:g} px, mask "
        "nonocc; lower is better"
    )
    return table(["scene", "optimal", "evaluation-Net", "times the optimal", *methods], cells, caption=caption)


def _areas(row: Row) -> list[str]:
    best = row.get("auc_optimal", 0)
    return [_area(best), _area(row["auc"]), f"{row['auc'] / best:.1f}" if best else "-"]


def _area(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"


def matcher_points(compared: Sequence[Row], scenes: int) -> list[Row]:
    """Return the mean of each other matcher that is cached for so many scenes: means over fewer do not compare."""
    rows = [row for row in _chosen(compared) if row["experiment"] == "density"]
    return [row for row in comparison_means(rows) if row["scene"] == f"mean of {scenes}" and "bad" in row]


def matchers_table(compared: Sequence[Row]) -> Html:
    """Return what other matchers that are cached report, beside the error of the kept pixels at the same density."""
    rows = [row for row in _chosen(compared) if row["experiment"] == "density"]
    if not rows:
        return ""
    head = ["method", "scene", "not kept (%)", "error of kept (%)", "error of dual-cnn at that density (%)"]
    figures = ("invalid", "bad", "bad_dual_cnn")
    means, every = (
        [
            [row["method"], row["scene"], *(f"{row[name]:.1f}" if name in row else "-" for name in figures)]
            for row in part
        ]
        for part in (comparison_means(rows), rows)
    )
    caption = f"Other matchers after their own checks: errors above {THRESHOLD_PX:g} px, mask nonocc"
    listed = table(head, means, caption=caption, words=2)
    return listed + folded("Scene by scene", table(head, every, caption=f"{caption}, scene by scene", words=2))
