"""Training the net that weighs the evidence, on pixels of the training scenes' maps."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from semidense.stages.evaluation.evidence.declaration import EvidenceNetParams, EvidentScenes
from semidense.stages.evaluation.evidence.features import of_whole_map
from semidense.stages.evaluation.evidence.net import EvidenceNet
from semidense.stages.learning.parameters import initialise, to_vector
from semidense.stages.learning.schedule import SHARDS
from semidense.stages.learning.training import fit
from semidense.stages.stage import DisparityMap, Images, Monitor, Network, Silent, Truth, by_scene

Pixels = tuple[NDArray[np.float32], NDArray[np.bool_]]
"""Features (pixel, feature), and whether each disparity is right (pixel,)."""


def train_evidence_net(params: EvidenceNetParams, inputs: EvidentScenes, monitor: Monitor | None = None) -> Network:
    """Train the net from nothing; its answer is the log-odds of a right disparity in the training scenes.

    Args:
        params: schedule and draw.
        inputs: ``images``, ``disparity`` with ``evidence``, and ``truth`` of every training scene; ``evaluation_net``.
        monitor: progress and checkpoints.

    Returns:
        ``parameters`` float32 (parameter,) and ``loss`` float32 (step,).

    Raises:
        StageError: if a map brings no evidence of its costs.
    """
    scenes = zip(by_scene(inputs["images"], "images"), inputs["disparity"], inputs["truth"], strict=True)
    drawn = [
        _drawn(params, np.random.default_rng((params.seed, number)), scene, inputs["evaluation_net"])
        for number, scene in enumerate(scenes)
    ]
    known = torch.from_numpy(np.concatenate([pixels for pixels, _ in drawn]))
    right = torch.from_numpy(np.concatenate([labels for _, labels in drawn]).astype(np.float32))
    net = EvidenceNet()
    initialise(net, params.seed)
    net.centre.copy_(known.mean(dim=0))
    net.scale.copy_(known.std(dim=0, correction=0).clamp(min=1e-3))

    def loss(step: int, shard: int) -> Tensor:
        rng = np.random.default_rng((params.seed, step, shard))
        chosen = torch.from_numpy(rng.integers(0, len(right), params.batch // SHARDS))
        return functional.binary_cross_entropy_with_logits(net(known[chosen]), right[chosen])

    curve = fit(net, loss, params, monitor or Silent())
    return {"parameters": to_vector(net), "loss": curve}


def _drawn(
    params: EvidenceNetParams,
    rng: np.random.Generator,
    scene: tuple[Images, DisparityMap, Truth],
    evaluation_net: Network,
) -> Pixels:
    """Draw pixels of a scene whose truth is known, hidden ones too: a map answers for those as well."""
    images, disparity, truth = scene
    stacked = of_whole_map(images, disparity, evaluation_net, params.precision).stacked
    error = np.abs(disparity["disparity"] - truth["disparity"]).ravel()
    judged = np.flatnonzero(np.isfinite(error))
    chosen = rng.choice(judged, min(params.pixels, judged.size), replace=False)
    return stacked.reshape(len(stacked), -1)[:, chosen].T, error[chosen] <= params.tolerance
