"""Pixels of a training scene's map, with what is known of each: what the net that weighs the evidence learns from."""

import numpy as np

from semidense.stages.evaluation.evidence.declaration import EvidenceSamples, EvidenceSamplesParams, EvidentScene
from semidense.stages.evaluation.evidence.features import of_whole_map


def draw_evidence_samples(params: EvidenceSamplesParams, inputs: EvidentScene) -> EvidenceSamples:
    """Draw pixels of a scene whose truth is known, hidden ones too: a map answers for those as well.

    Args:
        params: how many pixels, and the seed.
        inputs: ``images``, ``disparity`` with ``evidence``, ``truth`` and ``evaluation_net``.

    Returns:
        ``features`` float32 (pixel, feature) and ``error`` float32 (pixel,), px. A pixel without a disparity is not
        drawn; a scene with fewer pixels than ``params.pixels`` gives all it has.

    Raises:
        StageError: if the map brings no evidence of its costs.
    """
    disparity = inputs["disparity"]
    stacked = of_whole_map(inputs["images"], disparity, inputs["evaluation_net"], params.precision)
    error = np.abs(disparity["disparity"] - inputs["truth"]["disparity"]).ravel()
    judged = np.flatnonzero(np.isfinite(error))
    chosen = np.random.default_rng(params.seed).choice(judged, min(params.pixels, judged.size), replace=False)
    return {
        "features": np.ascontiguousarray(stacked.reshape(len(stacked), -1)[:, chosen].T),
        "error": error[chosen].astype(np.float32),
    }
