"""Compute the rows of a comparison: the figures of one map, or of one confidence, on one scene."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.pipeline.results.metric_rows import METHOD, without_chance
from semidense.stages.metrics.confidence import error_at_density
from semidense.stages.metrics.errors import MASKS, THRESHOLDS, Errors, counted
from semidense.stages.metrics.ranking import ranked
from semidense.stages.metrics.tally import Block, Tally
from semidense.stages.stage import Arrays

Row = dict[str, Any]
Mask = NDArray[np.bool_]
CURVE_R = (*(round(0.05 * step, 2) for step in range(19)), *(0.95, 0.96, 0.97, 0.98, 0.99, 0.995, 0.998, 0.999))
"""The thresholds of the curve of error against invalid pixels: closer near 1, where half of the pixels may lie."""


@dataclass(frozen=True)
class Judged:
    """A scene whose truth is known.

    Attributes:
        scene: its name.
        truth: the product ``truth``.
        masks: the masks to give figures for, of ``MASKS``.
        thresholds: the errors to give figures for, px, of ``THRESHOLDS``.
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
    """Yield the error of a dense map; pixels that it does not report count as wrong."""
    for row, mask, threshold in judged.rows("raw", method):
        yield row | _known({"raw_bad": Errors.of(dense, judged.disparity, mask).raw_bad(threshold)})


def density_rows(judged: Judged, method: str, reported: NDArray[np.float32]) -> Iterator[Row]:
    """Yield the errors of the pixels that a semi-dense map reports, and the share that it does not report."""
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
        density = 1 - row["invalid"] / 100 if "invalid" in row else 0
        yield row | (_known({"bad_dual_cnn": _error_at(density, row, judged, ours)}) if density > 0 else {})


def _error_at(density: float, row: Row, judged: Judged, ours: Mapping[str, NDArray[np.float32]]) -> float:
    """Return the error of our map at a density, with the mask and the threshold of a row."""
    pixels = judged.pixels(row["mask"])
    correct = Errors.of(ours["disparity"], judged.disparity, pixels).absolute <= row["threshold_px"]
    return error_at_density(ours["confidence"][counted(judged.disparity, pixels)], correct, density)


def curve_rows(judged: Judged, ours: Mapping[str, NDArray[np.float32]]) -> Iterator[Row]:
    """Yield invalid pixels and error of our map for every R of ``CURVE_R``; no error where it would be chance."""
    maps = Block(ours["disparity"], ours["confidence"], judged.disparity, judged.truth["nonocc"])
    tally = Tally.of([maps], CURVE_R)
    for row, _, threshold in judged.rows("curve", METHOD):
        for point in without_chance(tally.rows(judged.scene, row["mask"], threshold)):
            yield row | {name: point[name] for name in ("R", "bad", "invalid") if name in point}


def auc_rows(
    judged: Judged, method: str, confidence: NDArray[np.float32], disparity: NDArray[np.float32]
) -> Iterator[Row]:
    """Yield the area under the error curve of a confidence of a raw map, and the area of a perfect one."""
    by_mask: dict[str, dict[float, dict[str, float]]] = {}  # sorting is what takes time: all thresholds share it
    for row, mask, threshold in judged.rows("auc", method):
        if row["mask"] not in by_mask:
            by_mask[row["mask"]] = ranked(disparity, confidence, judged.disparity, mask)
        yield row | _known(by_mask[row["mask"]][threshold])


def _known(figures: Mapping[str, float]) -> dict[str, float]:
    """Return the figures without those that do not apply (NaN)."""
    return {name: value for name, value in figures.items() if not np.isnan(value)}
