"""What is known of each pixel of a training scene's map: what the net that weighs the evidence learns from."""

import numpy as np

from semidense.stages.evaluation.evidence.declaration import (
    REACH,
    EvidenceSamples,
    EvidenceSamplesParams,
    EvidentScene,
)
from semidense.stages.evaluation.evidence.features import of_whole_map
from semidense.stages.evaluation.samples import UNKNOWN, label_pixels
from semidense.stages.learning.truth import is_dense
from semidense.stages.stage import StageError


def compute_evidence_samples(params: EvidenceSamplesParams, inputs: EvidentScene) -> EvidenceSamples:
    """Tell what is known of a scene, and which pixels are right; hidden ones too: a map answers for those as well.

    Args:
        params: what is right.
        inputs: ``images``, ``disparity`` with ``evidence``, ``truth`` and ``evaluation_net``.

    Returns:
        ``features`` float16 (feature, seen, column) and ``right`` int8 (row, column): 1 right, 0 wrong, -1 without a
        disparity or a truth. The first row of ``right`` is row ``REACH`` of ``features``.

    Raises:
        StageError: if the map brings no evidence of its costs, or no pixel has both a disparity and a truth.
    """
    disparity, truth = inputs["disparity"]["disparity"], inputs["truth"]["disparity"]
    known = of_whole_map(inputs["images"], inputs["disparity"], inputs["evaluation_net"], params.precision, REACH)
    tolerance = params.tolerance + (0 if is_dense(truth) else params.laser_error)
    right = np.where(np.isnan(disparity), np.int8(UNKNOWN), label_pixels(disparity, truth, tolerance))
    if (right == UNKNOWN).all():
        raise StageError("a training scene has no pixel with a disparity and a known truth")
    return {"features": known.astype(np.float16), "right": right}
