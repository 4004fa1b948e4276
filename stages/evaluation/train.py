"""Training the evaluation-Net on grids of pixels of the training scenes' raw maps."""

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semidense.stages.compute.precision import autocast
from semidense.stages.evaluation.declaration import (
    PATCH,
    RADIUS,
    STRIDE,
    EvaluationNetParams,
    EvaluationSamples,
    ScoredScenes,
)
from semidense.stages.evaluation.layers import evaluation_layers
from semidense.stages.evaluation.net import EvaluationNet
from semidense.stages.learning.augmentation import relight
from semidense.stages.learning.parameters import initialise, to_vector
from semidense.stages.learning.scenes import Scenes
from semidense.stages.learning.schedule import SHARDS
from semidense.stages.learning.training import balanced_cross_entropy, fit
from semidense.stages.stage import DisparityMap, Images, Monitor, Network, Silent, by_scene


def train_evaluation_net(params: EvaluationNetParams, inputs: ScoredScenes, monitor: Monitor | None = None) -> Network:
    """Train an evaluation-Net from nothing.

    Args:
        params: schedule and augmentation.
        inputs: ``images``, ``disparity`` and ``right_disparity`` of every training scene, and ``evaluation_samples``.
        monitor: progress and checkpoints.

    Returns:
        ``parameters`` float32 (parameter,) and ``loss`` float32 (step,).
    """
    images, left, right = by_scene(inputs["images"], "images"), inputs["disparity"], inputs["right_disparity"]
    scenes = Scenes(lambda scene: _sides(images[scene], left[scene], right[scene]), len(images))
    net = EvaluationNet().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    initialise(net, params.seed)
    samples = inputs["evaluation_samples"]

    def loss(step: int, shard: int) -> Tensor:
        rng = np.random.default_rng((params.seed, step, shard))
        first = step * params.batch + shard
        chosen = [index % len(samples["scene"]) for index in range(first, (step + 1) * params.batch, SHARDS)]
        crops = np.stack([cut_crop(params, samples, index, scenes, rng) for index in chosen])
        labels = torch.from_numpy(samples["labels"][chosen].astype(np.int64))
        with autocast(params.precision):
            logits = upright_logits(net, crops, params.flip and bool(rng.random() < 0.5))
        return balanced_cross_entropy(logits.permute(1, 0, 2, 3).reshape(2, -1), labels.reshape(-1))

    curve = fit(net, loss, params, monitor or Silent())
    if params.prior:
        _undo_the_balance(net, samples["labels"])
    return {"parameters": to_vector(net), "loss": curve}


def _undo_the_balance(net: EvaluationNet, labels: NDArray[np.int8]) -> None:
    """Shift the net's log-odds by those of the samples' classes.

    By Bayes' rule, a score learnt where both classes weighed the same becomes the probability where they are as
    frequent as in the samples. The order of the scores stays.
    """
    right, wrong = (np.count_nonzero(labels == label) for label in (1, 0))
    if net.out.bias is not None and right and wrong:
        with torch.no_grad():
            net.out.bias[1] += np.log(right / wrong)


def _sides(images: Images, left: DisparityMap, right: DisparityMap) -> NDArray[np.float32]:
    """Return the layers of one scene: (side, layer, y, x), upright, and of the right view and its map, mirrored."""
    upright = evaluation_layers(images["left"], images["moments"][0], left["disparity"])
    mirrored = evaluation_layers(images["right"], images["moments"][1], right["disparity"])[:, :, ::-1]
    return np.stack([upright, mirrored])


def cut_crop(
    params: EvaluationNetParams,
    samples: EvaluationSamples,
    index: int,
    scenes: Sequence[NDArray[np.float32]] | Scenes[NDArray[np.float32]],
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Cut out what the grid of one sample depends on; beyond the image the nearest pixel, as in inference.

    Returns:
        float32 (layer, 101 + 16 (rows - 1), 101 + 16 (columns - 1)).
    """
    scene = scenes[int(samples["scene"][index])][int(samples["mirrored"][index])]
    rows, columns = (
        np.clip(np.arange(first - RADIUS, first - RADIUS + PATCH + STRIDE * (count - 1)), 0, length - 1)
        for first, count, length in zip(
            (int(samples["y"][index]), int(samples["x"][index])),
            samples["labels"].shape[1:],
            scene.shape[1:],
            strict=True,
        )
    )
    return relight(scene[:, rows[:, None], columns], params.relight, rng)


def upright_logits(net: EvaluationNet, crops: NDArray[np.float32], flipped: bool) -> Tensor:
    """Return the logits of crops; flipped, of the crops upside down, in the order of the upright ones."""
    layers = torch.from_numpy(crops[:, :, ::-1].copy() if flipped else crops)
    logits: Tensor = net(layers.contiguous(memory_format=torch.channels_last))
    return logits.flip(2) if flipped else logits
