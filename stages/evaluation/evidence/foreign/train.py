"""Training the net that scores foreign maps, on pixels of the training scenes' maps by several matchers."""

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from semidense.stages.evaluation.evidence.foreign.declaration import OF_CELLS, ForeignNetParams, OfForeignSamples
from semidense.stages.evaluation.evidence.foreign.net import ForeignNet
from semidense.stages.learning.parameters import initialise, to_vector
from semidense.stages.learning.schedule import SHARDS
from semidense.stages.learning.training import fit
from semidense.stages.stage import Monitor, Network, Silent, by_scene


def train_foreign_net(params: ForeignNetParams, inputs: OfForeignSamples, monitor: Monitor | None = None) -> Network:
    """Train the net from nothing; its answer is the log-odds of a right disparity in the training scenes' maps.

    A share of the pixels is shown without what the right view says, so that one net scores maps with and without it.

    Args:
        params: schedule, and that share.
        inputs: ``foreign_samples`` of every training scene.
        monitor: progress and checkpoints.

    Returns:
        ``parameters`` float32 (parameter,) and ``loss`` float32 (step,).
    """
    scenes = by_scene(inputs["foreign_samples"], "foreign_samples")
    known = torch.from_numpy(np.concatenate([scene["features"] for scene in scenes]))
    error = np.concatenate([scene["error"] for scene in scenes])
    right = torch.from_numpy((error <= params.tolerance).astype(np.float32))
    net = ForeignNet()
    initialise(net, params.seed)
    net.keep(known.mean(dim=0), known.std(dim=0, correction=0))

    def loss(step: int, shard: int) -> Tensor:
        rng = np.random.default_rng((params.seed, step, shard))
        chosen = torch.from_numpy(rng.integers(0, len(right), params.batch // SHARDS))
        seen = known[chosen]
        seen[: round(params.blind * len(seen)), -len(OF_CELLS) :] = 0
        return functional.binary_cross_entropy_with_logits(net(seen), right[chosen])

    curve = fit(net, loss, params, monitor or Silent())
    return {"parameters": to_vector(net), "loss": curve}
