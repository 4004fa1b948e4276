"""What a confidence is worth: how often pixels of that confidence are right in scenes that no network has seen."""

from collections.abc import Sequence
from typing import TypedDict

import numpy as np

from semidense.stages.evaluation.calibration.declaration import MAPS, Calibrated, Calibration, CalibrationParams
from semidense.stages.evaluation.calibration.maps import FITS, calibrate, cross_validate
from semidense.stages.evaluation.calibration.table import Table, tally
from semidense.stages.evaluation.declaration import Confidence
from semidense.stages.learning.truth import is_dense
from semidense.stages.stage import DisparityMap, NoParams, StageError, Truth, by_scene


class ScoredMaps(TypedDict):
    """The confidence, the raw map and the truth of every training scene."""

    confidence: Sequence[Confidence]
    disparity: Sequence[DisparityMap]
    truth: Sequence[Truth]


class Uncalibrated(TypedDict):
    """A confidence and what it is worth."""

    confidence: Confidence
    calibration: Calibration


def compute_calibration(params: CalibrationParams, inputs: ScoredMaps) -> Calibration:
    """Compute the product ``calibration``; of the maps, that of the lowest score on scenes it was not fitted to.

    Raises:
        StageError: if there is not one fold for each scene.
    """
    scores_of = by_scene(inputs["confidence"], "confidence")
    scenes = zip(scores_of, inputs["disparity"], inputs["truth"], strict=True)
    counts, tolerances = [], []
    for confidence, disparity, truth in scenes:
        tolerances.append(params.tolerance + (0 if is_dense(truth["disparity"]) else params.laser_error))
        counts.append(tally(confidence["confidence"], disparity["disparity"], truth["disparity"], tolerances[-1]))
    table = Table(np.stack([right for right, _ in counts]), np.stack([wrong for _, wrong in counts]))
    folds = np.array(params.fold_of_scene or (), np.intp)
    if folds.size != len(counts) or len(np.unique(folds)) < 2:
        raise StageError(f"{folds.size} folds were given for {len(counts)} scenes: one a scene, and two different ones")
    scores = [cross_validate(table, folds, FITS[name]) for name in MAPS]
    return {
        "right": table.right,
        "wrong": table.wrong,
        "score": np.array(scores),
        "log_odds": FITS[MAPS[int(np.argmin(scores))]](table),
        "tolerance": np.array(tolerances),
    }


def compute_calibrated_confidence(_: NoParams, inputs: Uncalibrated) -> Calibrated:
    """Compute the product ``calibrated_confidence``; see ``calibrate``."""
    return {"confidence": calibrate(inputs["confidence"]["confidence"], inputs["calibration"]["log_odds"])}
