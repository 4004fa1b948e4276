"""Rows of figures: the name, unit and meaning of each figure, and the mean over scenes."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

Row = Mapping[str, Any]
METHOD = "dual-cnn"
"""The name of this project's method in rows, tables and figures."""
MASK, THRESHOLD = "nonocc", 1.0
"""Mask and threshold, px of the image at hand, of tables and figures that show one; files and JSON have all."""


class Figure(NamedTuple):
    """The name, unit, digits and meaning of a figure.

    Attributes:
        heading: of its column, without the unit.
        unit: ``%``, ``px``, or ``1`` for a pure number.
        digits: after the point.
        meaning: one line for people.
    """

    heading: str
    unit: str
    digits: int
    meaning: str

    @property
    def head(self) -> str:
        """The head of its column, with the unit."""
        return self.heading if self.unit == "1" else f"{self.heading} {self.unit}"

    def text(self, value: float | None) -> str:
        """Return a value as text; ``-`` where the figure does not apply (None or NaN)."""
        return "-" if value is None or math.isnan(value) else f"{value:,.{self.digits}f}"


FIGURES = {
    "pixels": Figure("pixels", "1", 0, "pixels of the mask whose true disparity is known"),
    "raw_bad": Figure("raw bad", "%", 2, "wrong or unreported pixels of the map before filtering"),
    "bad": Figure("bad", "%", 2, "wrong pixels among those the filtered map reports"),
    "invalid": Figure("invalid", "%", 2, "pixels that the filtered map does not report"),
    "bad_dual_cnn": Figure("bad of dual-cnn, same density", "%", 2, "wrong pixels of dual-cnn at the same density"),
    "avgerr": Figure("avgerr", "px", 2, "mean absolute error of the reported pixels"),
    "rms": Figure("rms", "px", 2, "root mean squared error of the reported pixels"),
    **{
        f"A{share}": Figure(f"A{share}", "px", 2, f"error that {share} % of the reported pixels do not exceed")
        for share in (50, 90, 95, 99)
    },
    "auc": Figure("AUC", "1", 4, "area under the error curve of the confidence over the map before filtering"),
    "auc_optimal": Figure("AUC optimal", "1", 4, "area that a perfect confidence would reach"),
}
"""Every figure of a row or of the product ``metrics``, in the order of columns."""
_MOST = 99.0
"""Invalid pixels up to which an error is more than chance, percent."""
_ALIKE = ("experiment", "method", "variant", "mask", "threshold_px", "R")


def mean_name(scenes: int) -> str:
    """Return what a mean over so many scenes has in the place of a scene's name."""
    return f"mean of {scenes}"


def over_scenes(mean: Row) -> str:
    """Return what a mean row is a mean of, for people: ``mean of 8 scenes``."""
    return f"{mean['scene']} scene{'' if mean['scene'] == mean_name(1) else 's'}"


def mean_rows(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return the mean over the scenes, for rows that agree in everything else; its ``scene`` is ``mean of N``.

    A figure that one of the N scenes lacks has no mean: means over different scenes cannot be compared. ``pixels`` is
    their sum.
    """
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row.get(name) for name in _ALIKE), []).append(row)
    return [_mean(group) for group in groups.values()]


def _mean(rows: Sequence[Row]) -> dict[str, Any]:
    shared = [name for name in FIGURES if all(name in row for row in rows)]
    means = {name: sum(row[name] for row in rows) / len(rows) for name in shared}
    same = {name: value for name, value in rows[0].items() if name not in FIGURES}
    return same | {"scene": mean_name(len(rows))} | means | {"pixels": sum(row["pixels"] for row in rows)}


def without_chance(rows: Sequence[Row]) -> list[Row]:
    """Return the rows of a curve, without ``bad`` where fewer than one pixel in a hundred is reported.

    The error of a handful of pixels is chance. The rows are returned as they are if no row reports more.
    """
    steady = [row if row["invalid"] <= _MOST else _without_error(row) for row in rows]
    return steady if any("bad" in row for row in steady) else [*rows]


def _without_error(row: Row) -> Row:
    return {name: value for name, value in row.items() if name != "bad"}


def with_means(rows: Sequence[Row]) -> list[Row]:
    """Return the rows, and after those of several scenes their means."""
    return [*rows, *(mean_rows(rows) if _several(rows) else ())]


def averaged(rows: Sequence[Row]) -> list[Row]:
    """Return the means over several scenes; of a single scene its rows."""
    return [*mean_rows(rows)] if _several(rows) else [*rows]


def _several(rows: Sequence[Row]) -> bool:
    return len({row["scene"] for row in rows}) > 1
