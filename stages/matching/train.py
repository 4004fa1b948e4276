"""Training the matching-Net on crops or patches of the training scenes.

The form ``dense`` computes conv1 and conv2 once a crop and compares it at all its disparities, which is over
a hundred times the samples a second of the paper's way, ``patch``.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from semidense.stages.compute.precision import Precision, autocast
from semidense.stages.learning.parameters import initialise, to_vector
from semidense.stages.learning.scenes import Scenes
from semidense.stages.learning.schedule import SHARDS
from semidense.stages.learning.training import fit
from semidense.stages.matching.crops import Crop, cells_loss, cut_crop, measure_channels
from semidense.stages.matching.declaration import MatchingNetParams, OfSamples
from semidense.stages.matching.net import SIDES, MatchingNet
from semidense.stages.matching.winograd.tiles import TILE
from semidense.stages.matching.winograd.training import joined_units
from semidense.stages.matching.winograd.volume import TransformedNet, is_transformable
from semidense.stages.stage import Monitor, Network, Silent, by_scene


def train_matching_net(params: MatchingNetParams, inputs: OfSamples, monitor: Monitor | None = None) -> Network:
    """Train a matching-Net from nothing.

    Args:
        params: architecture and schedule.
        inputs: ``channels`` of every training scene (``channels``: view, channel, y, x) and
            ``matching_samples`` as ``draw_samples`` makes them.
        monitor: progress and checkpoints.

    Returns:
        ``parameters`` float32 (parameter,) and ``loss`` float32 (step,).
    """
    products = by_scene(inputs["channels"], "channels")
    scenes = Scenes(lambda scene: products[scene]["channels"], len(products))
    net = MatchingNet(scenes[0].shape[1], params.head).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    initialise(net, params.seed)
    measure_channels(net, scenes)
    samples = inputs["matching_samples"]

    def loss(step: int, shard: int) -> Tensor:
        rng = np.random.default_rng((params.seed, step, shard))
        first = step * params.batch + shard
        chosen = range(first, (step + 1) * params.batch, SHARDS)
        crops = [cut_crop(samples, index % len(samples["scene"]), scenes, params.relight, rng) for index in chosen]
        with autocast(params.precision):
            return crops_loss(net, crops, params.ranking, params.precision)

    curve = fit(net, loss, params, monitor or Silent())
    return {"parameters": to_vector(net), "loss": curve}


def crops_loss(net: MatchingNet, crops: Sequence[Crop], ranking: float, precision: Precision = "float32") -> Tensor:
    """Return the class-balanced cross-entropy of all cells of the crops, plus ``ranking`` times their ranking loss."""
    transformed = TransformedNet.of(net) if precision == "float32" and is_transformable(net) else None
    logits = [_logits(net, transformed, crop).float() for crop in crops]
    return cells_loss(logits, [crop.labels for crop in crops], ranking)


def _logits(net: MatchingNet, transformed: TransformedNet | None, crop: Crop) -> Tensor:
    """Return the logits (slot, 2, h, w) of a crop at each of its disparities."""
    height, width = crop.labels.shape[1:]
    if transformed is None or min(height, width) < TILE:  # of a tile, a patch would use one cell
        return _direct_logits(net, crop)
    left, strip = (
        # The filters of a pixel lie side by side, and the crop is made up to whole tiles.
        functional.pad(net.embed_layers(view, side).permute(0, 2, 3, 1), (0, 0, 0, -width % TILE, 0, -height % TILE))
        for view, side in ((crop.left, SIDES[0]), (crop.strip, SIDES[1]))
    )
    units = joined_units(left.contiguous(), strip.contiguous(), [int(start) for start in crop.starts], transformed)
    return net.logits_of_features(units[:, :height, :width])


def _direct_logits(net: MatchingNet, crop: Crop) -> Tensor:
    left = net.embed(crop.left, "left")
    strip = net.embed(crop.strip, "right")
    pieces: tuple[Tensor, ...] = _Windows.apply(  # type: ignore[no-untyped-call]
        strip, [int(start) for start in crop.starts], left.shape[3]
    )
    # One disparity at a time: its maps stay in the processor's cache, which a batch of all would not.
    return torch.cat([net.join(left, piece) for piece in pieces])


class _Windows(torch.autograd.Function):
    """Windows of a strip, columns ``start`` to ``start + width``, whose gradients meet in one buffer.

    Plain slices would each make a gradient as wide as the strip, nearly all of it zero.
    """

    @staticmethod
    def forward(ctx: Any, strip: Tensor, starts: list[int], width: int) -> tuple[Tensor, ...]:  # noqa: ANN401
        ctx.shape, ctx.starts, ctx.width = strip.shape, starts, width
        return tuple(strip[..., start : start + width].clone() for start in starts)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None, None]:  # noqa: ANN401
        total = torch.zeros(ctx.shape, dtype=gradients[0].dtype).contiguous(memory_format=torch.channels_last)
        for start, gradient in zip(ctx.starts, gradients, strict=True):
            total[..., start : start + ctx.width] += gradient
        return total, None, None
