"""The tables of figures: errors and densities, and how well the confidence ranks pixels."""

from collections.abc import Sequence

from semidense.pipeline.comparison.rows import Row
from semidense.pipeline.comparison.rows import mean_rows as comparison_means
from semidense.pipeline.pages.html import Html, folded, table, tag, text
from semidense.pipeline.pages.report.gathered import MASK, THRESHOLD_PX
from semidense.pipeline.results.metric_rows import mean_rows

_COLUMNS = {
    "pixels": ("pixels", "{:,.0f}"),
    "raw_bad": ("raw error (%)", "{:.1f}"),
    "bad": ("error of kept (%)", "{:.1f}"),
    "invalid": ("not kept (%)", "{:.1f}"),
    "avgerr": ("mean error of kept (px)", "{:.2f}"),
    "rms": ("rms of kept (px)", "{:.2f}"),
}
_NONE_CACHED = (
    "No other matcher is cached for these scenes; `pipeline compare` makes them, and they then stand here too."
)


def metrics_tables(rows: Sequence[Row], R: float) -> Html:
    """Return the table at the first threshold, and folded those at all thresholds and masks."""
    caption = f"Errors above {THRESHOLD_PX:g} px, mask {MASK}, R = {R:g}"
    every = [[row["scene"], row["mask"], f"{row['threshold_px']:g}", *_cells(row)] for row in _with_mean(rows)]
    head = [title for title, _ in _COLUMNS.values()]
    more = table(["scene", "mask", "threshold (px)", *head], every, caption="All thresholds and masks", words=2)
    chosen = [row for row in rows if row["mask"] == MASK and row["threshold_px"] == THRESHOLD_PX]
    first = [[row["scene"], *_cells(row)] for row in _with_mean(chosen)]
    return table(["scene", *head], first, caption=caption) + folded("All thresholds and masks", more)


def _with_mean(rows: Sequence[Row]) -> list[Row]:
    return [*rows, *mean_rows(rows)]


def _cells(row: Row) -> list[str]:
    return [form.format(row[name]) if name in row else "-" for name, (_, form) in _COLUMNS.items()]


def auc_table(compared: Sequence[Row]) -> Html:
    """Return the area under the error curve of each cached measure of confidence beside what a perfect one reaches."""
    rows = _area_rows(compared)
    if not rows:
        return ""
    means = comparison_means(rows)
    every = {(row["scene"], row["method"]): row for row in [*rows, *(means if len(means) < len(rows) else ())]}
    scenes, methods = (list(dict.fromkeys(pair[axis] for pair in every)) for axis in (0, 1))
    own, *others = methods
    cells = [
        [scene, *_areas(every[scene, own]), *(_area(every.get((scene, method), {})) for method in others)]
        for scene in scenes
        if (scene, own) in every
    ]
    caption = (
        f"How well a confidence ranks pixels: area under the error curve, errors above {THRESHOLD_PX:g} px, mask "
        f"{MASK}; lower is better"
    )
    return table(["scene", "optimal", own, "times the optimal", *others], cells, caption=caption)


def _areas(row: Row) -> list[str]:
    best = row["auc_optimal"]
    return [f"{best:.4f}", _area(row), f"{row['auc'] / best:.1f}" if best else "-"]


def _area(row: Row) -> str:
    return f"{row['auc']:.4f}" if "auc" in row else "-"


def _area_rows(compared: Sequence[Row]) -> list[Row]:
    return [row for row in compared if row["experiment"] == "auc" and "auc" in row]


def _density_rows(compared: Sequence[Row]) -> list[Row]:
    return [row for row in compared if row["experiment"] == "density"]


def matcher_points(compared: Sequence[Row], scenes: int) -> list[Row]:
    """Return the mean of each other matcher that is cached for so many scenes: means over fewer do not compare."""
    over = f"mean of {scenes}"
    means = [row for row in comparison_means(_density_rows(compared)) if row["scene"] == over and "bad" in row]
    return [row | {"method": f"{row['method']}, {over}"} for row in means] if scenes > 1 else means


def measure_points(compared: Sequence[Row]) -> list[Row]:
    """Return the areas of the measures that are cached for every scene; none if it is one measure alone."""
    rows = _area_rows(compared)
    scenes = {row["scene"] for row in rows}
    methods = [
        method
        for method in dict.fromkeys(row["method"] for row in rows)
        if {row["scene"] for row in rows if row["method"] == method} == scenes
    ]
    return [row for row in rows if row["method"] in methods] if len(methods) > 1 else []


def matchers_table(compared: Sequence[Row]) -> Html:
    """Return what other matchers that are cached report, beside the error of the kept pixels at the same density."""
    rows = _density_rows(compared)
    if not rows:
        return tag("p", text(_NONE_CACHED), class_="quiet")
    head = ["method", "scene", "not kept (%)", "error of kept (%)", "error of dual-cnn at that density (%)"]
    figures = ("invalid", "bad", "bad_dual_cnn")
    means, every = (
        [
            [row["method"], row["scene"], *(f"{row[name]:.1f}" if name in row else "-" for name in figures)]
            for row in part
        ]
        for part in (comparison_means(rows), rows)
    )
    caption = f"Other matchers after their own checks: errors above {THRESHOLD_PX:g} px, mask {MASK}"
    if len(means) == len(rows):  # a single scene
        return table(head, every, caption=caption, words=2)
    return table(head, means, caption=caption, words=2) + folded(
        "Scene by scene", table(head, every, caption=f"{caption}, scene by scene", words=2)
    )
