"""The semi-dense map: only disparities that the evaluation network trusts."""

import math
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from semidense.stages.evaluation.calibration.declaration import Calibrated
from semidense.stages.evaluation.declaration import Confidence
from semidense.stages.stage import DisparityMap, Output, Params, Stage, StageError, require_share


class SemidenseParams(Params):
    """How much confidence a disparity needs."""

    R: float = Field(default=0.9, ge=0, le=1, description="smallest confidence that is kept; 0.9 in the paper")
    density: float | None = Field(
        default=None, gt=0, le=1, description="keep this share of the image, the most confident pixels; replaces R"
    )
    max_error: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="share of wrong pixels that is expected among the kept ones; replaces R",
    )
    calibrated: bool = Field(
        default=False, description="take R as a calibrated probability (product calibrated_confidence)"
    )

    @property
    def by_R(self) -> bool:  # noqa: N802 - the paper's name
        """Whether R itself is what decides."""
        return self.density is None and self.max_error is None

    @property
    def inputs(self) -> tuple[str, ...]:
        """The products that these settings need."""
        needed = {"confidence": not self.calibrated, "calibrated_confidence": self.calibrated or bool(self.max_error)}
        return ("disparity", *(name for name, is_needed in needed.items() if is_needed))

    @model_validator(mode="after")
    def _one_wish(self) -> "SemidenseParams":
        if self.density is not None and self.max_error is not None:
            raise ValueError("density and max_error both say how much to keep; give one of them")
        return self

    @model_serializer(mode="wrap")
    def _that_matter(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out R where it is replaced: it is in no key then."""
        fields: dict[str, Any] = dump(self)
        return {name: value for name, value in fields.items() if self.by_R or name != "R"}


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
        confidence: (y, x) float in [0, 1]; a pixel of confidence 0, where nothing was seen, is never kept.

    Returns:
        The confidence of the last pixel that is kept. As many pixels as asked for are kept, and those that tie with
        the last one; fewer only where fewer have a disparity and a confidence above 0. 1 if none has.

    >>> threshold_for(0.5, np.array([[1.0, 2.0, 3.0, np.nan]]), np.array([[0.2, 0.7, 0.9, 0.99]]))
    0.7
    """
    require_share("density", density)
    scores = confidence[np.isfinite(disparity) & (confidence > 0)]
    if not scores.size:
        return 1.0
    asked = math.ceil(round(density * disparity.size, 6))  # 0.07 * 100 is a little more than 7
    kept = min(scores.size, max(1, asked))
    return float(np.partition(scores, scores.size - kept)[scores.size - kept])


def threshold_for_error(max_error: float, disparity: NDArray[Any], probability: NDArray[Any]) -> float:
    """Return the probability down to which pixels can be kept for a share of wrong ones that is at most as wished.

    What to expect of the kept pixels is the mean of their own probabilities of being wrong. So in a harder map, which
    has lower ones, less is kept.

    Args:
        max_error: share of wrong pixels among the kept, in (0, 1).
        disparity: (y, x) float, NaN unknown; a pixel without one is never kept.
        probability: (y, x) float in [0, 1], calibrated: that the disparity is right; a pixel of probability 0, where
            nothing was seen, is never kept.

    Returns:
        The least probability that is kept; 1 if no pixel is sure enough.

    >>> threshold_for_error(0.15, np.array([[1.0, 2.0, 3.0, np.nan]]), np.array([[0.7, 0.9, 0.8, 1.0]]))
    0.8
    """
    require_share("max_error", max_error)
    scores = probability[np.isfinite(disparity) & (probability > 0)]
    values, counts = np.unique(scores.astype(np.float64), return_counts=True)
    wrong, kept = np.cumsum((counts * (1 - values))[::-1]), np.cumsum(counts[::-1])
    reached = np.flatnonzero(wrong <= max_error * kept)
    return float(values[::-1][reached[-1]]) if reached.size else 1.0


class Scored(TypedDict):
    """What is filtered, and by what."""

    disparity: DisparityMap
    confidence: Confidence
    calibrated_confidence: Calibrated


class Semidense(TypedDict):
    """The product ``semidense``: (y, x) disparities in px, NaN: confidence below R; (1,) R."""

    disparity: NDArray[np.float32]
    R: NDArray[np.float64]


def compute_semidense(params: SemidenseParams, inputs: Scored) -> Semidense:
    """Compute the product ``semidense``; see ``keep_confident``, ``threshold_for`` and ``threshold_for_error``."""
    disparity = inputs["disparity"]["disparity"]
    judged = inputs["calibrated_confidence"] if params.calibrated else inputs["confidence"]
    confidence = judged["confidence"]
    R = params.R
    if params.density is not None:
        R = threshold_for(params.density, disparity, confidence)
    elif params.max_error is not None:
        probability = inputs["calibrated_confidence"]["confidence"]
        sure = probability >= threshold_for_error(params.max_error, disparity, probability)
        R = float(confidence[sure].min(initial=1.0))
    return {"disparity": keep_confident(disparity, confidence, R), "R": np.array([R])}


SEMIDENSE = Stage(
    product="semidense",
    inputs=("disparity", "confidence", "calibrated_confidence"),
    outputs=(
        Output("disparity", ("y", "x"), "float32", "px", "disparity of the left view; NaN: confidence below R"),
        Output("R", ("all",), "float64", "1", "least confidence that was kept"),
    ),
    compute="semidense.stages.evaluation.filtering:compute_semidense",
    params=SemidenseParams,
)
"""The filtered disparity. A sweep over R makes only this product and what is below it again. Not tiled: a density is
that of the whole map. Only those inputs are made that the settings need."""
