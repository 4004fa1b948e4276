"""The product ``ranking``: the figures of a scene before filtering, which no threshold on the confidence changes."""

from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from semidense.stages.evaluation.declaration import Confidence
from semidense.stages.metrics.confidence import Ranking, optimal_auc
from semidense.stages.metrics.errors import MASKS, THRESHOLDS, Errors, counted, pixels_of, require_equal
from semidense.stages.stage import Array, DisparityMap, NoParams, Output, Stage, Truth

RANKED = ("pixels", "raw_bad", "auc", "auc_optimal")
"""The order of the figure axis."""
DIMS = ("figure", "mask", "threshold")
AXES = f"of {', '.join(MASKS)}; wrong above {', '.join(f'{threshold:g}' for threshold in THRESHOLDS)} px"


class Figures(TypedDict):
    """A product of figures: (figure, mask, threshold)."""

    figures: NDArray[np.float64]


class Rated(TypedDict):
    """The map before filtering, its confidence and the truth."""

    disparity: DisparityMap
    confidence: Confidence
    truth: Truth


def compute_ranking(_: NoParams, inputs: Rated) -> Figures:
    """Compute the product ``ranking``: each of ``RANKED`` for each of ``MASKS`` and ``THRESHOLDS``.

    Raises:
        StageError: if a map has not the shape of the ground truth.
    """
    truth = inputs["truth"]["disparity"]
    disparity, confidence = inputs["disparity"]["disparity"], inputs["confidence"]["confidence"]
    nonocc = inputs["truth"]["nonocc"]
    for name, array in (("disparity", disparity), ("confidence", confidence), ("nonocc", nonocc)):
        require_equal(name, array, truth)
    by_mask = [ranked(disparity, confidence, truth, mask) for mask in pixels_of(nonocc)]
    figures = [[[cell[name] for cell in each.values()] for each in by_mask] for name in RANKED]
    return {"figures": np.array(figures, np.float64)}


def ranked(disparity: Array, confidence: Array, truth: Array, mask: NDArray[np.bool_]) -> dict[float, dict[str, float]]:
    """Return each of ``RANKED``, by threshold and name.

    Args:
        disparity: (y, x) float, px, NaN unknown; before filtering.
        confidence: (y, x) float, higher is surer, NaN where there is none.
        truth: (y, x) float, px, not finite where unknown.
        mask: (y, x) bool.
    """
    errors = Errors.of(disparity, truth, mask)
    ranking = Ranking.of(confidence[counted(truth, mask)])
    return {
        threshold: {
            "pixels": errors.absolute.size,
            "raw_bad": errors.raw_bad(threshold),
            "auc": ranking.auc(errors.absolute <= threshold),
            "auc_optimal": optimal_auc(errors.raw_bad(threshold) / 100),
        }
        for threshold in THRESHOLDS
    }


RANKING = Stage(
    product="ranking",
    inputs=("disparity", "confidence", "truth"),
    outputs=(Output("figures", DIMS, "float64", "1", f"{', '.join(RANKED)}; {AXES}"),),
    compute="semidense.stages.metrics.ranking:compute_ranking",
)
"""Sorting the pixels takes most of the time of all figures; a sweep over R finds it done. Not tiled: a rank is one of
the whole image. ``truth`` has ``disparity`` (y, x) float32, px, NaN unknown, and ``nonocc`` (y, x) bool."""
