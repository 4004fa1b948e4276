"""Training the descriptor-Net on the matching-Net's crops, each compared at every disparity of its scene.

A disparity more costs only products of descriptors, so a crop meets all of the scene's range, not the sample's few.
"""

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semidense.stages.compute.precision import Precision, autocast
from semidense.stages.learning.parameters import initialise, to_vector
from semidense.stages.learning.scenes import Scenes
from semidense.stages.learning.schedule import SHARDS
from semidense.stages.learning.training import fit
from semidense.stages.matching.crops import Crop, cells_loss, cut_crop, measure_channels
from semidense.stages.matching.declaration import REACH, MatchingSamples
from semidense.stages.matching.descriptors.declaration import DescriptorNetParams, OfSummed
from semidense.stages.matching.descriptors.net import DescriptorNet
from semidense.stages.matching.descriptors.summed import cut_wide_crop, summed_loss, wide_scenes
from semidense.stages.matching.descriptors.transformed_training import describer
from semidense.stages.matching.descriptors.volume import diagonals
from semidense.stages.matching.samples import ABSENT
from semidense.stages.stage import Monitor, Network, Silent, by_scene


def train_descriptor_net(params: DescriptorNetParams, inputs: OfSummed, monitor: Monitor | None = None) -> Network:
    """Train a descriptor-Net from nothing: first on single cells, then, if asked for, on costs summed along paths.

    Args:
        params: schedule and augmentation.
        inputs: as for ``train_matching_net``; with ``summed_steps`` also ``images`` and ``truth`` of every scene.
        monitor: progress and checkpoints.

    Returns:
        ``parameters`` float32 (parameter,) and ``loss`` float32 (step,).
    """
    products = by_scene(inputs["channels"], "channels")
    scenes = Scenes(lambda scene: products[scene]["channels"], len(products))
    net = DescriptorNet(scenes[0].shape[1], params.width)
    net = net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    initialise(net, params.seed)
    measure_channels(net, scenes)
    samples = inputs["matching_samples"]
    slots = {int(scene): _range(samples, scene) for scene in np.unique(samples["scene"])}

    wide = wide_scenes(inputs) if params.summed_steps else None

    def loss(step: int, shard: int) -> Tensor:
        rng = np.random.default_rng((params.seed, step, shard))
        if wide and step >= params.steps:
            return summed_loss(net, cut_wide_crop(params, samples, scenes, wide, rng), params.precision)
        first = step * params.batch + shard
        chosen = [index % len(samples["scene"]) for index in range(first, (step + 1) * params.batch, SHARDS)]
        crops = [
            cut_crop(samples, index, scenes, params.relight, rng, slots[int(samples["scene"][index])], REACH)
            for index in chosen
        ]
        with autocast(params.precision):
            logits = crops_logits(net, crops, params.precision)
        return cells_loss(logits, [crop.labels for crop in crops], params.ranking)

    curve = fit(net, loss, params, monitor or Silent())
    return {"parameters": to_vector(net), "loss": curve}


def crops_logits(net: DescriptorNet, crops: Sequence[Crop], precision: Precision = "float32") -> list[Tensor]:
    """Return the logits (slot, 2, y, x) of each crop, compared at consecutive disparities, in ascending order."""
    describe = describer(net, precision)
    return [_logits(net, describe(crop.left), describe(crop.strip), len(crop.starts)) for crop in crops]


def _logits(net: DescriptorNet, left: Tensor, strip: Tensor, slots: int) -> Tensor:
    mismatch = net.log_odds(diagonals(left @ strip.mT, slots)).flip(2).permute(2, 0, 1)
    return torch.stack([torch.zeros_like(mismatch), mismatch], 1)


def _range(samples: MatchingSamples, scene: int) -> NDArray[np.int32]:
    """Return all disparities from the smallest to the largest that a scene's samples have."""
    known = samples["disparities"][samples["scene"] == scene]
    known = known[known != ABSENT]
    return np.arange(known.min(), known.max() + 1, dtype=np.int32)
