"""The tables of figures: errors and densities, and how well the confidence ranks pixels."""

from collections.abc import Mapping, Sequence
from typing import Any

from semidense.pipeline.comparison.rows import Row
from semidense.pipeline.pages.html import Html, folded, table, tag
from semidense.pipeline.results.metric_rows import FIGURES, MASK, THRESHOLD, mean_name, mean_rows, with_means

_COLUMNS = ("raw_bad", "bad", "invalid", "avgerr", "rms", "pixels")


def metrics_tables(rows: Sequence[Row], kept: str) -> Html:
    """Return the table at ``THRESHOLD``, and below it, folded, the table of all thresholds and masks.

    Args:
        rows: metrics rows.
        kept: by what the maps are filtered, as ``filter_text`` says it.
    """
    caption = f"Errors above {THRESHOLD:g} px, mask {MASK}, kept at {kept}"
    every = [[row["scene"], row["mask"], f"{row['threshold_px']:g}", *_cells(row)] for row in with_means(rows)]
    head = [FIGURES[name].head for name in _COLUMNS]
    more = table(["scene", "mask", "threshold (px)", *head], every, caption="All thresholds and masks", words=2)
    chosen = [row for row in rows if row["mask"] == MASK and row["threshold_px"] == THRESHOLD]
    first = [[row["scene"], *_cells(row)] for row in with_means(chosen)]
    return table(["scene", *head], first, caption=caption) + folded("All thresholds and masks", more)


def _cells(row: Mapping[str, Any]) -> list[str]:
    return [FIGURES[name].text(row.get(name)) for name in _COLUMNS]


def auc_table(compared: Sequence[Row]) -> Html:
    """Return a table of the areas under the error curve: of a perfect confidence and of each cached measure."""
    rows = _area_rows(compared)
    if not rows:
        return ""
    means = mean_rows(rows)
    every = {(row["scene"], row["method"]): row for row in [*rows, *(means if len(means) < len(rows) else ())]}
    scenes, methods = (list(dict.fromkeys(pair[axis] for pair in every)) for axis in (0, 1))
    own, *others = methods
    cells = [
        [scene, *_areas(every[scene, own]), *(_area(every.get((scene, method), {})) for method in others)]
        for scene in scenes
        if (scene, own) in every
    ]
    caption = (
        f"How well a confidence ranks pixels: area under the error curve, errors above {THRESHOLD:g} px, mask "
        f"{MASK}; lower is better"
    )
    return table(["scene", "optimal", own, "times the optimal", *others], cells, caption=caption)


def _areas(row: Row) -> list[str]:
    best = row["auc_optimal"]
    return [FIGURES["auc_optimal"].text(best), _area(row), f"{row['auc'] / best:.1f}" if best else "-"]


def _area(row: Row) -> str:
    return FIGURES["auc"].text(row.get("auc"))


def _area_rows(compared: Sequence[Row]) -> list[Row]:
    return [row for row in compared if row["experiment"] == "auc" and "auc" in row]


def _density_rows(compared: Sequence[Row]) -> list[Row]:
    return [row for row in compared if row["experiment"] == "density"]


def matcher_points(compared: Sequence[Row], scenes: int) -> list[Row]:
    """Return the mean of each other matcher that is cached for all ``scenes``: a mean over fewer cannot be compared."""
    over = mean_name(scenes)
    means = [row for row in mean_rows(_density_rows(compared)) if row["scene"] == over and "bad" in row]
    return [row | {"method": f"{row['method']}, {over}"} for row in means] if scenes > 1 else means


def measure_points(compared: Sequence[Row]) -> list[Row]:
    """Return the areas of the measures that are cached for every scene; no row if there is only one measure."""
    rows = _area_rows(compared)
    scenes = {row["scene"] for row in rows}
    methods = [
        method
        for method in dict.fromkeys(row["method"] for row in rows)
        if {row["scene"] for row in rows if row["method"] == method} == scenes
    ]
    return [row for row in rows if row["method"] in methods] if len(methods) > 1 else []


def matchers_table(compared: Sequence[Row]) -> Html:
    """Return a table of the other cached matchers, with the error of dual-cnn at the density of each."""
    rows = _density_rows(compared)
    if not rows:
        told = ("No other matcher is cached for these scenes. ", tag("code", "pipeline compare"), " adds some.")
        return tag("p", *told, class_="quiet")
    figures = ("invalid", "bad", "bad_dual_cnn")
    head = ["method", "scene", *(FIGURES[name].head for name in figures)]
    means, every = (
        [[row["method"], row["scene"], *(FIGURES[name].text(row.get(name)) for name in figures)] for row in part]
        for part in (mean_rows(rows), rows)
    )
    caption = f"Other matchers after their own checks: errors above {THRESHOLD:g} px, mask {MASK}"
    if len(means) == len(rows):  # a single scene
        return table(head, every, caption=caption, words=2)
    return table(head, means, caption=caption, words=2) + folded(
        "Scene by scene", table(head, every, caption=f"{caption}, scene by scene", words=2)
    )
