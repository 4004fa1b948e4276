"""The semi-dense map: only disparities that the evaluation network trusts."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from stages.stage import Arrays, Inputs, Output, Params, Stage, StageError


class SemidenseParams(Params):
    """How much confidence a disparity needs."""

    R: float = Field(default=0.9, ge=0, le=1, description="least confidence that is kept; 0.9 in the paper")


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


def require_share(name: str, value: float) -> None:
    """Refuse a number outside [0, 1].

    Raises:
        StageError: naming it and its value; NaN is outside.
    """
    if not 0 <= value <= 1:
        raise StageError(f"{name} is {value:g}, expected a number in [0, 1]")


def compute_semidense(params: SemidenseParams, inputs: Inputs) -> Arrays:
    """Compute the product ``semidense``; see ``keep_confident``."""
    disparity, confidence = inputs["disparity"]["disparity"], inputs["confidence"]["confidence"]
    return {"disparity": keep_confident(disparity, confidence, params.R)}


SEMIDENSE = Stage(
    product="semidense",
    inputs=("disparity", "confidence"),
    outputs=(Output("disparity", ("y", "x"), "float32", "px", "disparity of the left view; NaN: confidence below R"),),
    compute="stages.filtering:compute_semidense",
    params=SemidenseParams,
    tile_rows=128,
)
"""The filtered disparity. A sweep over R makes only this product and what is below it again."""
