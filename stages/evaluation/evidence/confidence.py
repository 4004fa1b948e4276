"""The confidence of each pixel of a map by summed costs, weighed from all that is known of it."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from semidense.stages.compute.threads import one_thread
from semidense.stages.evaluation.confidence import sigmoid
from semidense.stages.evaluation.declaration import Confidence
from semidense.stages.evaluation.evidence.declaration import REACH, EvidenceConfidenceParams, WithEvidence
from semidense.stages.evaluation.evidence.features import features
from semidense.stages.evaluation.evidence.net import EvidenceNet
from semidense.stages.evaluation.evidence.of_map import AGREEMENT, NETWORK, opened
from semidense.stages.evaluation.silence.veto import vetoed
from semidense.stages.learning.parameters import from_vector, unset
from semidense.stages.stage import Images


@one_thread()
def weigh(parameters: NDArray[np.float32], known: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the log-odds (y, x) that each disparity is right, of features (feature, y + 2 REACH, x)."""
    net = unset(partial(EvidenceNet, len(known)))
    from_vector(net, parameters)
    with torch.inference_mode():
        odds: NDArray[np.float32] = net(torch.from_numpy(known)[None])[0].numpy()
    return odds


def compute_evidence_confidence(params: EvidenceConfidenceParams, inputs: WithEvidence) -> Confidence:
    """Return one tile of the confidence map, from a block with its halo.

    Raises:
        StageError: if the disparity map brings no evidence of its costs.
    """
    # The net looks away from a row; beside the map it sees nothing.
    images: Images = {**inputs["images"], "left": inputs["images"]["left"][:, REACH:-REACH]}
    maps: Mapping[str, Any] = inputs["disparity"]
    disparity = {name: array[..., REACH:-REACH] for name, array in maps.items()}
    known = features(images, disparity, inputs["evaluation_net"], params.precision)
    confidence = sigmoid(weigh(inputs["evidence_net"]["parameters"], known))
    middle = known[:, REACH:-REACH]
    return {
        "confidence": np.where(_vetoed(inputs), np.float32(0), confidence) if params.veto else confidence,
        "network": sigmoid(opened(middle[NETWORK])),
        "agreement": opened(middle[AGREEMENT]),
    }


def _vetoed(inputs: WithEvidence) -> NDArray[np.bool_]:
    around = (slice(REACH, -REACH),) * 2
    views = inputs["distinctiveness"]
    return vetoed(
        {
            "distinctiveness": {"left": views["left"][around], "right": views["right"][around]},
            "disparity": {"disparity": inputs["disparity"]["disparity"][around]},
            "cost_margin": {"margin": inputs["cost_margin"]["margin"][around]},
        }
    )
