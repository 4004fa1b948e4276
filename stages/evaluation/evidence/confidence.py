"""The confidence of each pixel of a map by summed costs, weighed from all that is known of it."""

import numpy as np
import torch
from numpy.typing import NDArray

from semidense.stages.compute.threads import one_thread
from semidense.stages.evaluation.confidence import sigmoid
from semidense.stages.evaluation.declaration import Confidence
from semidense.stages.evaluation.evidence.declaration import EvidenceConfidenceParams, WithEvidence
from semidense.stages.evaluation.evidence.features import features
from semidense.stages.evaluation.evidence.net import EvidenceNet
from semidense.stages.evaluation.evidence.of_map import AGREEMENT, NETWORK, opened
from semidense.stages.evaluation.silence.veto import vetoed
from semidense.stages.learning.parameters import from_vector


@one_thread()
def weigh(parameters: NDArray[np.float32], stacked: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the log-odds (y, x) that each disparity is right, of features (feature, y, x)."""
    net = EvidenceNet(len(stacked))
    from_vector(net, parameters)
    with torch.inference_mode():
        rows = np.ascontiguousarray(stacked.reshape(len(stacked), -1).T)
        odds: NDArray[np.float32] = net(torch.from_numpy(rows)).numpy()
    return odds.reshape(stacked.shape[1:])


def compute_evidence_confidence(params: EvidenceConfidenceParams, inputs: WithEvidence) -> Confidence:
    """Return one tile of the confidence map, from a block with its halo.

    Raises:
        StageError: if the disparity map brings no evidence of its costs.
    """
    known = features(inputs["images"], inputs["disparity"], inputs["evaluation_net"], params.precision)
    confidence = sigmoid(weigh(inputs["evidence_net"]["parameters"], known))
    return {
        "confidence": np.where(vetoed(inputs), np.float32(0), confidence) if params.veto else confidence,
        "network": sigmoid(opened(known[NETWORK])),
        "agreement": opened(known[AGREEMENT]),
    }
