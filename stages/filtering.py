"""The semi-dense map: only disparities that the evaluation network trusts."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from stages.evaluation.calibration_maps import map_threshold
from stages.evaluation.calibration_table import Table, choose
from stages.stage import Arrays, Inputs, Output, Params, Stage, StageError


class SemidenseParams(Params):
    """How much confidence a disparity needs."""

    R: float = Field(default=0.9, ge=0, le=1, description="least confidence that is kept; 0.9 in the paper")
    density: float | None = Field(
        default=None, gt=0, le=1, description="share of the image's pixels to keep, the most confident; replaces R"
    )
    max_error: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="share of wrong pixels among the kept, as measured on held-out training scenes; replaces R",
    )
    calibrated: bool = Field(default=False, description="R is a calibrated probability (calibrated_confidence)")

    @property
    def by_R(self) -> bool:  # noqa: N802 - the paper's name
        """Whether R itself is what decides."""
        return self.density is None and self.max_error is None

    @property
    def inputs(self) -> tuple[str, ...]:
        """The products that these settings need."""
        confidence = "calibrated_confidence" if self.calibrated else "confidence"
        return ("disparity", confidence, *(("calibration",) if self.max_error is not None else ()))

    @model_validator(mode="after")
    def _one_wish(self) -> "SemidenseParams":
        if self.density is not None and self.max_error is not None:
            raise ValueError("density and max_error both say how much to keep; give one of them")
        return self


def keep_confident(disparity: NDArray[Any], confidence: NDArray[Any], R: float) -> NDArray[np.float32]:
    """Return the disparities whose confidence is at least R.

    Args:
        disparity: (y, x) float, px, NaN unknown.
        confidence: (y, x) float in [0, 1], NaN where there is none. R is rounded to its dtype, so that R = 0.9 keeps
            a float32 confidence of 0.9.
        R: the least confidence kept, in [0, 1].

    Returns:
        (y, x) float32, px; NaN where ``confidence < R``, where it is NaN and where the disparity is.

    Raises:
        StageError: if R is outside [0, 1] or the shapes differ.

    >>> keep_confident(np.array([[4.0, 5.0, 6.0]]), np.array([[0.95, 0.2, np.nan]]), R=0.9).tolist()
    [[4.0, nan, nan]]
    """
    require_share("R", R)
    if disparity.shape != confidence.shape:
        raise StageError(f"disparity has shape {disparity.shape}, confidence {confidence.shape}: they must be equal")
    kept = confidence >= confidence.dtype.type(R)
    return np.where(kept, disparity, np.nan).astype(np.float32)


def threshold_for(density: float, disparity: NDArray[Any], confidence: NDArray[Any]) -> float:
    """Return the R that keeps a share of the image's pixels: those of the highest confidence.

    Args:
        density: the share of all pixels, in (0, 1].
        disparity: (y, x) float, NaN unknown; a pixel without one is never kept.
        confidence: (y, x) float in [0, 1].

    Returns:
        The confidence of the last pixel that is kept. As many pixels as asked for are kept, and those that tie with
        the last one; fewer only where fewer have a disparity. 1 if none has.

    >>> threshold_for(0.5, np.array([[1.0, 2.0, 3.0, np.nan]]), np.array([[0.2, 0.7, 0.9, 0.99]]))
    0.7
    """
    require_share("density", density)
    scores = confidence[np.isfinite(disparity) & np.isfinite(confidence)]
    if not scores.size:
        return 1.0
    kept = min(scores.size, max(1, math.ceil(density * disparity.size)))
    return float(np.partition(scores, scores.size - kept)[scores.size - kept])


def require_share(name: str, value: float) -> None:
    """Refuse a number outside [0, 1].

    Raises:
        StageError: naming it and its value; NaN is outside.
    """
    if not 0 <= value <= 1:
        raise StageError(f"{name} is {value:g}, expected a number in [0, 1]")


def compute_semidense(params: SemidenseParams, inputs: Inputs) -> Arrays:
    """Compute the product ``semidense``; see ``keep_confident``, ``threshold_for`` and ``choose``."""
    disparity = inputs["disparity"]["disparity"]
    confidence = inputs["calibrated_confidence" if params.calibrated else "confidence"]["confidence"]
    R = params.R
    if params.density is not None:
        R = threshold_for(params.density, disparity, confidence)
    elif params.max_error is not None:
        R = _threshold_of(params.max_error, params.calibrated, inputs["calibration"])
    return {"disparity": keep_confident(disparity, confidence, R), "R": np.array([R])}


def _threshold_of(max_error: float, calibrated: bool, calibration: Arrays) -> float:
    """Return the R for a wanted error, on the scale of the confidence that is filtered."""
    R = choose(Table.of(calibration), max_error).R
    return map_threshold(R, calibration["log_odds"]) if calibrated else R


SEMIDENSE = Stage(
    product="semidense",
    inputs=("disparity", "confidence", "calibration", "calibrated_confidence"),
    outputs=(
        Output("disparity", ("y", "x"), "float32", "px", "disparity of the left view; NaN: confidence below R"),
        Output("R", ("all",), "float64", "1", "least confidence that was kept"),
    ),
    compute="stages.filtering:compute_semidense",
    params=SemidenseParams,
)
"""The filtered disparity. A sweep over R makes only this product and what is below it again. Not tiled: a density is
that of the whole map. Only those inputs are made that the settings need."""
