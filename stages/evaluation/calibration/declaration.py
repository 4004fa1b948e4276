"""What the calibration of the confidence is made from, and what can be set. Light: it loads nothing heavy."""

from typing import TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from semidense.stages.stage import Output, Params, Stage

BINS = 400
"""Bins of confidence, of equal width in log-odds."""
LARGEST = 10.0
"""Log-odds that the bins reach up to, and down to with a minus: confidences of 0.000045 to 0.999955."""
MAPS = ("none", "platt", "isotonic")
"""Maps from confidence to probability that are tried, in the order of the product's ``score``."""


class CalibrationParams(Params):
    """How it is found out what the confidence is worth."""

    folds: int = Field(
        2,
        ge=2,
        le=10,
        description="number of parts of the training scenes; networks of the other parts score each",
    )
    tolerance: float = Field(1.0, gt=0, description="largest error of a disparity that counts as correct, px")
    laser_error: float = Field(
        0.25, ge=0, description="what is allowed beside it where the truth is sparse: a laser measured it, px"
    )
    fold_of_scene: tuple[int, ...] | None = Field(
        None, description="part of each training scene; default: in turn, scenes like Cloth1 and Cloth2 together"
    )


class Calibration(TypedDict):
    """The product ``calibration``: counts of right and wrong pixels by confidence, and the map that fits them best."""

    right: NDArray[np.int64]
    wrong: NDArray[np.int64]
    score: NDArray[np.float64]
    log_odds: NDArray[np.float64]
    tolerance: NDArray[np.float64]


CALIBRATION = Stage(
    product="calibration",
    inputs=("confidence", "disparity", "truth"),
    outputs=(
        Output("right", ("scene", "bin"), "int64", "1", "right pixels by confidence, bins of log-odds from -10 to 10"),
        Output("wrong", ("scene", "bin"), "int64", "1", "wrong pixels by confidence"),
        Output("score", ("map",), "float64", "1", "Brier score on scenes not fitted to: none, Platt, isotonic"),
        Output("log_odds", ("edge",), "float64", "1", "calibrated log-odds at the edges of the bins"),
        Output("tolerance", ("scene",), "float64", "px", "largest error of a right disparity of the scene"),
    ),
    compute="semidense.stages.evaluation.calibration.stage:compute_calibration",
    params=CalibrationParams,
    scope="split",
    learnt=True,
    cross_fitted=True,
)
"""How often a pixel of a confidence is right, in training scenes whose raw map and confidence come from networks that
have not seen them (cross-fitting). ``disparity`` and ``confidence`` are one a scene, made by the networks of its
fold."""


class Calibrated(TypedDict):
    """The product ``calibrated_confidence``: (y, x) probability."""

    confidence: NDArray[np.float32]


CALIBRATED_CONFIDENCE = Stage(
    product="calibrated_confidence",
    inputs=("confidence", "calibration"),
    outputs=(
        Output(
            "confidence", ("y", "x"), "float32", "1", "calibrated probability that the disparity is right, in [0, 1]"
        ),
    ),
    compute="semidense.stages.evaluation.calibration.stage:compute_calibrated_confidence",
)
"""The confidence as a probability that was measured; the order of the pixels is that of ``confidence``."""
