"""The figures of a comparison: what one map, or one confidence, does on one scene."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.metrics import MASKS, THRESHOLDS, Errors, Ranking, error_at_density, error_curve, optimal_auc
from semidense.stages.metrics.errors import counted
from semidense.stages.stage import Arrays

Row = dict[str, Any]
Mask = NDArray[np.bool_]
CURVE_R = (*(round(0.05 * step, 2) for step in range(20)), 0.99)
"""The thresholds of the curve of error against invalid pixels."""
OURS = "dual-cnn"
FIGURES = {
    "raw_bad": "wrong or unreported pixels of the dense map, %",
    "bad": "wrong pixels among the reported, %",
    "invalid": "pixels that are not reported, %",
    "bad_dual_cnn": "wrong pixels of dual-cnn at the same density, %",
    "avgerr": "mean absolute error of the reported pixels, px",
    "rms": "root mean squared error of the reported pixels, px",
    **{name: f"error that {name[1:]} % of the reported pixels keep to, px" for name in ("A50", "A90", "A95", "A99")},
    "auc": "area under the error curve of a confidence",
    "auc_optimal": "the area that a perfect confidence reaches",
}
"""Every figure of a row and its meaning."""


@dataclass(frozen=True)
class Judged:
    """A scene whose truth is known.

    Attributes:
        scene: its name.
        truth: the product ``truth``.
        masks: those that figures are wanted for, of ``MASKS``.
        thresholds: px, those that figures are wanted for.
    """

    scene: str
    truth: Arrays
    masks: Sequence[str] = MASKS
    thresholds: Sequence[float] = THRESHOLDS

    def rows(self, experiment: str, method: str) -> Iterator[tuple[Row, Mask, float]]:
        """Yield the start of a row, its mask and its threshold, for each mask and threshold."""
        for mask in self.masks:
            pixels = self.pixels(mask)
            counts = int(counted(self.disparity, pixels).sum())
            for threshold in self.thresholds:
                named = {"experiment": experiment, "scene": self.scene, "method": method, "mask": mask}
                yield named | {"threshold_px": threshold, "pixels": counts}, pixels, threshold

    def pixels(self, mask: str) -> Mask:
        """Return the pixels (y, x) of a mask, whether their truth is known or not."""
        chosen: Mask = self.truth["nonocc"] if mask == "nonocc" else np.ones(self.disparity.shape, bool)
        return chosen

    @property
    def disparity(self) -> NDArray[np.float32]:
        """The true disparity."""
        found: NDArray[np.float32] = self.truth["disparity"]
        return found


def raw_rows(judged: Judged, method: str, dense: NDArray[np.float32]) -> Iterator[Row]:
    """Yield the error of a dense map: what it does not report counts as wrong."""
    for row, mask, threshold in judged.rows("raw", method):
        yield row | _known({"raw_bad": Errors.of(dense, judged.disparity, mask).raw_bad(threshold)})


def density_rows(judged: Judged, method: str, reported: NDArray[np.float32]) -> Iterator[Row]:
    """Yield what a semi-dense map does on the pixels that it reports."""
    for row, mask, threshold in judged.rows("density", method):
        errors = Errors.of(reported, judged.disparity, mask)
        figures = {
            "bad": errors.bad(threshold),
            "invalid": errors.invalid(),
            "avgerr": errors.avgerr(),
            "rms": errors.rms(),
        }
        yield row | _known(figures | errors.quantiles())


def equal_density(rows: Iterator[Row], judged: Judged, ours: Mapping[str, NDArray[np.float32]]) -> Iterator[Row]:
    """Yield rows with the error of our map at the density of each; ``ours`` has ``disparity`` and ``confidence``."""
    for row in rows:
        chosen = counted(judged.disparity, judged.pixels(row["mask"]))
        correct = np.abs(ours["disparity"] - judged.disparity)[chosen] <= row["threshold_px"]
        density = 1 - row["invalid"] / 100 if "invalid" in row else 0
        figure = error_at_density(ours["confidence"][chosen], correct, density) if density > 0 else float("nan")
        yield row | _known({"bad_dual_cnn": figure})


def curve_rows(judged: Judged, ours: Mapping[str, NDArray[np.float32]]) -> Iterator[Row]:
    """Yield error and invalid pixels of our map for every R of ``CURVE_R``."""
    for row, mask, threshold in judged.rows("curve", OURS):
        curve = error_curve(ours["confidence"], ours["disparity"], judged.disparity, mask, threshold, CURVE_R)
        for R, bad, invalid in zip(*(values.tolist() for values in curve), strict=True):
            yield row | {"R": R} | _known({"bad": bad, "invalid": invalid})


def auc_rows(
    judged: Judged, method: str, confidence: NDArray[np.float32], disparity: NDArray[np.float32]
) -> Iterator[Row]:
    """Yield the area under the error curve of a confidence of a raw map, and the area of a perfect one."""
    rankings: dict[str, Ranking] = {}  # sorting is what takes time, and all thresholds share it
    for row, mask, threshold in judged.rows("auc", method):
        chosen = counted(judged.disparity, mask)
        if row["mask"] not in rankings:
            rankings[row["mask"]] = Ranking.of(confidence[chosen])
        correct = np.abs(disparity - judged.disparity)[chosen] <= threshold
        error_rate = float(np.mean(~correct)) if correct.size else float("nan")
        auc = rankings[row["mask"]].auc(correct)
        yield row | _known({"raw_bad": 100 * error_rate, "auc": auc, "auc_optimal": optimal_auc(error_rate)})


def _known(figures: Mapping[str, float]) -> dict[str, float]:
    """Return the figures that apply: a key whose figure is NaN is absent."""
    return {name: float(value) for name, value in figures.items() if not np.isnan(value)}


def mean_rows(rows: list[Row]) -> list[Row]:
    """Return the mean over scenes of each figure, for rows that differ in nothing but the scene.

    A figure that a scene lacks has no mean: means over different scenes could not be compared.
    """
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        key = tuple(row.get(name) for name in ("experiment", "method", "mask", "threshold_px", "R"))
        groups.setdefault(key, []).append(row)
    return [_mean(group) for group in groups.values()]


def _mean(rows: list[Row]) -> Row:
    shared = [name for name in FIGURES if all(name in row for row in rows)]
    same = {name: value for name, value in rows[0].items() if name not in FIGURES}
    means = {name: float(np.mean([row[name] for row in rows])) for name in shared}
    return same | {"scene": f"mean of {len(rows)}", "pixels": sum(row["pixels"] for row in rows)} | means
