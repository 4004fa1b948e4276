"""Training the net that weighs the evidence, on pixels of the training scenes' maps."""

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from semidense.stages.evaluation.evidence.declaration import EvidenceNetParams, OfEvidenceSamples
from semidense.stages.evaluation.evidence.net import EvidenceNet
from semidense.stages.learning.parameters import initialise, to_vector
from semidense.stages.learning.schedule import SHARDS
from semidense.stages.learning.training import fit
from semidense.stages.stage import Monitor, Network, Silent, by_scene


def train_evidence_net(params: EvidenceNetParams, inputs: OfEvidenceSamples, monitor: Monitor | None = None) -> Network:
    """Train the net from nothing; its answer is the log-odds of a right disparity in the training scenes.

    Args:
        params: schedule.
        inputs: ``evidence_samples`` of every training scene.
        monitor: progress and checkpoints.

    Returns:
        ``parameters`` float32 (parameter,) and ``loss`` float32 (step,).
    """
    samples = by_scene(inputs["evidence_samples"], "evidence_samples")
    known = torch.from_numpy(np.concatenate([each["features"] for each in samples]))
    errors = torch.from_numpy(np.concatenate([each["error"] for each in samples]))
    right = (errors <= params.tolerance).float()
    net = EvidenceNet()
    initialise(net, params.seed)
    net.measure(known)

    def loss(step: int, shard: int) -> Tensor:
        rng = np.random.default_rng((params.seed, step, shard))
        chosen = torch.from_numpy(rng.integers(0, len(right), params.batch // SHARDS))
        return functional.binary_cross_entropy_with_logits(net(known[chosen]), right[chosen])

    curve = fit(net, loss, params, monitor or Silent())
    return {"parameters": to_vector(net), "loss": curve}
