"""The confidence of each pixel of a map that another matcher made."""

import numpy as np

from semidense.stages.evaluation.confidence import sigmoid
from semidense.stages.evaluation.declaration import RADIUS, Confidence
from semidense.stages.evaluation.evidence.confidence import weigh
from semidense.stages.evaluation.evidence.foreign.cells import described
from semidense.stages.evaluation.evidence.foreign.declaration import Foreign, ForeignConfidenceParams
from semidense.stages.evaluation.evidence.foreign.features import features
from semidense.stages.evaluation.evidence.of_map import AGREEMENT, NETWORK, opened


def compute_foreign_confidence(params: ForeignConfidenceParams, inputs: Foreign) -> Confidence:
    """Return one tile of the confidence map, from a block with its halo; 0 where the map has no disparity."""
    disparity = inputs["disparity"]["disparity"]
    costs = None
    if params.right:
        views = described(inputs["channels"]["channels"], inputs["descriptor_net"], params.precision)
        costs = views.costs(disparity)
    known = features(inputs["images"], disparity, inputs["evaluation_net"], costs, params.precision)
    confidence = sigmoid(weigh(inputs["foreign_net"]["parameters"], known))
    has_none = np.isnan(disparity[RADIUS:-RADIUS, RADIUS:-RADIUS])
    return {
        "confidence": np.where(has_none, np.float32(0), confidence),
        "network": sigmoid(opened(known[NETWORK])),
        "agreement": opened(known[AGREEMENT]),
    }
