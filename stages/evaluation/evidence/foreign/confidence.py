"""The confidence of each pixel of a map that another matcher made."""

import numpy as np
import torch
from numpy.typing import NDArray

from semidense.stages.compute.threads import one_thread
from semidense.stages.evaluation.confidence import sigmoid
from semidense.stages.evaluation.declaration import RADIUS, Confidence
from semidense.stages.evaluation.evidence.foreign.cells import described
from semidense.stages.evaluation.evidence.foreign.declaration import Foreign, ForeignConfidenceParams
from semidense.stages.evaluation.evidence.foreign.features import features
from semidense.stages.evaluation.evidence.foreign.net import ForeignNet
from semidense.stages.evaluation.evidence.of_map import AGREEMENT, NETWORK, opened
from semidense.stages.learning.parameters import from_vector


@one_thread()
def weigh(parameters: NDArray[np.float32], known: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the log-odds (y, x) that each disparity is right, of features (feature, y, x)."""
    net = ForeignNet()
    from_vector(net, parameters)
    with torch.inference_mode():
        pixels = np.ascontiguousarray(known.reshape(len(known), -1).T)
        odds: NDArray[np.float32] = net(torch.from_numpy(pixels)).numpy()
    return odds.reshape(known.shape[1:])


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
