"""Rows of figures, a scene each, and their mean over the scenes."""

from collections.abc import Mapping, Sequence
from typing import Any

SWEEP_THRESHOLD = 1.0
"""The threshold of the table and of the curve of a sweep, px; the CSV has all."""
FIGURES = ("raw_bad", "bad", "invalid", "avgerr", "rms", "auc", "auc_optimal")
HEADINGS = {
    "raw_bad": "raw bad %",
    "bad": "bad %",
    "invalid": "invalid %",
    "avgerr": "avgerr px",
    "rms": "rms px",
    "auc": "AUC",
    "auc_optimal": "AUC optimal",
}


def mean_rows(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the mean over scenes for each threshold, mask, R and variant; nothing for a single scene."""
    if len({row["scene"] for row in rows}) < 2:
        return []
    groups: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault(tuple(row.get(name) for name in ("variant", "mask", "threshold_px", "R")), []).append(row)
    return [_mean(group) for group in groups.values()]


def _mean(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the mean of each figure over the scenes that have it."""
    means: dict[str, float] = {}
    for name in FIGURES:
        values = [row[name] for row in rows if name in row]
        means |= {name: sum(values) / len(values)} if values else {}
    pixels = sum(row["pixels"] for row in rows)
    return {**rows[0], "scene": f"mean of {len(rows)}", "pixels": pixels} | means
