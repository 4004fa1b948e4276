"""The confidence of each pixel of a map that another matcher made."""

import numpy as np

from semidense.stages.evaluation.confidence import sigmoid
from semidense.stages.evaluation.declaration import Confidence
from semidense.stages.evaluation.evidence.confidence import weigh
from semidense.stages.evaluation.evidence.declaration import REACH
from semidense.stages.evaluation.evidence.foreign.cells import described
from semidense.stages.evaluation.evidence.foreign.declaration import Foreign, ForeignConfidenceParams
from semidense.stages.evaluation.evidence.foreign.features import features
from semidense.stages.evaluation.evidence.of_map import AGREEMENT, NETWORK, middle, opened
from semidense.stages.stage import Images


def compute_foreign_confidence(params: ForeignConfidenceParams, inputs: Foreign) -> Confidence:
    """Return one tile of the confidence map, from a block with its halo; 0 where the map has no disparity."""
    # The net looks away from a row; beside the map it sees nothing.
    images: Images = {**inputs["images"], "left": inputs["images"]["left"][:, REACH:-REACH]}
    disparity = inputs["disparity"]["disparity"][:, REACH:-REACH]
    costs = None
    if params.right:
        channels = inputs["channels"]["channels"][..., REACH:-REACH]
        costs = described(channels, inputs["descriptor_net"], params.precision).costs(disparity)
    known = features(images, disparity, inputs["evaluation_net"], costs, params.precision)
    confidence = sigmoid(weigh(inputs["foreign_net"]["parameters"], known))
    own = known[:, REACH:-REACH]
    has_none = np.isnan(middle(disparity)[REACH:-REACH])
    return {
        "confidence": np.where(has_none, np.float32(0), confidence),
        "network": sigmoid(opened(own[NETWORK])),
        "agreement": opened(own[AGREEMENT]),
    }
