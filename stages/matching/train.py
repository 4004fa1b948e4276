"""Training the matching-Net on crops or patches of the training scenes.

The paper's objective is the cross-entropy of match and mismatch, both classes weighing the same, in either form
of samples: ``dense`` computes conv1 and conv2 once a crop and compares it at all disparities, which is over
a hundred times the samples a second of the paper's way.

That loss judges each cell alone, while the winner is taken among the cells of a pixel, and after some hundred
steps nearly all mismatches are told easily. The *ranking loss* adds what is left to learn: the negative log of
the match's share in the softmax over a pixel's disparities, whose gradient goes to the mismatches that rival it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from stages.augmentation import relight
from stages.matching.declaration import RADIUS, MatchingNetParams
from stages.matching.net import SIDES, MatchingNet
from stages.matching.samples import ABSENT
from stages.matching.transformed import TransformedNet, is_transformable
from stages.matching.transformed_training import joined_units
from stages.matching.winograd import TILE
from stages.parameters import initialise, to_vector
from stages.precision import Precision, autocast
from stages.schedule import SHARDS
from stages.stage import Arrays, Inputs, Monitor, Silent, by_scene
from stages.training import balanced_cross_entropy, fit

IGNORED = -1


def train_matching_net(
    params: MatchingNetParams, inputs: Inputs, monitor: Monitor | None = None
) -> dict[str, NDArray[np.float32]]:
    """Train a matching-Net from nothing.

    Args:
        params: architecture and schedule.
        inputs: ``channels`` of every training scene (``channels``: view, channel, y, x) and
            ``matching_samples`` as ``draw_samples`` makes them.
        monitor: progress and checkpoints.

    Returns:
        ``parameters`` float32 (parameter,) and ``loss`` float32 (step,).
    """
    scenes = [scene["channels"] for scene in by_scene(inputs, "channels")]
    net = MatchingNet(scenes[0].shape[1], params.head).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    initialise(net, params.seed)
    _measure_channels(net, scenes)
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


def _measure_channels(net: MatchingNet, scenes: Sequence[NDArray[np.float32]]) -> None:
    """Give the net the mean and the standard deviation of each channel over the training scenes."""
    means = np.mean([scene.mean((0, 2, 3), dtype=np.float64) for scene in scenes], 0)
    squares = np.mean([np.square(scene, dtype=np.float64).mean((0, 2, 3)) for scene in scenes], 0)
    net.input_mean.copy_(torch.from_numpy(means))
    net.input_std.copy_(torch.from_numpy(np.sqrt(np.maximum(squares - means**2, 1e-8))))


class Crop:
    """One sample, cut out: the left crop, the strip of the right view that its disparities reach, the labels."""

    def __init__(self, left: Tensor, strip: Tensor, starts: NDArray[np.int64], labels: Tensor) -> None:
        self.left = left  # 1 l h+10 w+10
        self.strip = strip  # 1 l h+10 w+10+span
        self.starts = starts  # slot: column of the strip at which a slot's right crop begins
        self.labels = labels  # slot h w: 0 match, 1 mismatch, IGNORED


def cut_crop(
    samples: Arrays,
    index: int,
    scenes: Sequence[NDArray[np.float32]],
    strength: float,
    rng: np.random.Generator,
) -> Crop:
    """Cut one sample out of its scene, with another light on each view.

    Args:
        samples: arrays as ``draw_samples`` makes them.
        index: the sample.
        scenes: float32 (view, channel, y, x) of each training scene. Beyond an image comes its nearest pixel.
        strength: of the random lighting; 0 for none.
        rng: source of that lighting.
    """
    views = scenes[int(samples["scene"][index])]
    if samples["mirrored"][index]:
        views = views[::-1, :, :, ::-1]
    truth, slots = samples["truth"][index], samples["disparities"][index]
    slots = slots[slots != ABSENT]
    y, x = int(samples["y"][index]), int(samples["x"][index])
    rows = np.arange(y - RADIUS, y + truth.shape[0] + RADIUS)
    columns = np.arange(x - RADIUS, x + truth.shape[1] + RADIUS)
    reach = np.arange(columns[0] - slots.max(), columns[-1] - slots.min() + 1)
    left = relight(_cut(views[0], rows, columns), strength, rng)
    strip = relight(_cut(views[1], rows, reach), strength, rng)
    labels = label_cells(truth, slots, x, views.shape[3])
    return Crop(_tensor(left), _tensor(strip), (slots.max() - slots).astype(np.int64), torch.from_numpy(labels))


def _cut(view: NDArray[np.float32], rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return rows and columns of a view; beyond the image the nearest pixel, as in the cost volume."""
    height, width = view.shape[1:]
    return view[:, np.clip(rows, 0, height - 1)[:, None], np.clip(columns, 0, width - 1)]


def _tensor(view: NDArray[np.float32]) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(view)).unsqueeze(0).contiguous(memory_format=torch.channels_last)


def label_cells(truth: NDArray[np.float32], slots: NDArray[np.int32], x: int, width: int) -> NDArray[np.int64]:
    """Return the label of each cell: 0 within 0.5 px of the truth, 1 more than 1 px away, else ``IGNORED``.

    Args:
        truth: float32 (row, column), px, NaN where nothing is known.
        slots: int32 (slot,), the disparities, px.
        x: the crop's first column in the image.
        width: the image's columns; a cell whose right pixel lies outside is ignored.

    Returns:
        int64 (slot, row, column).
    """
    error = np.abs(slots[:, None, None] - truth)  # NaN compares false: such a cell stays ignored
    labels = np.full(error.shape, IGNORED, np.int64)
    labels[error <= 0.5] = 0
    labels[error > 1.0] = 1
    right = x + np.arange(truth.shape[1]) - slots[:, None]
    labels[np.broadcast_to(((right < 0) | (right >= width))[:, None, :], labels.shape)] = IGNORED
    return labels


def crops_loss(net: MatchingNet, crops: Sequence[Crop], ranking: float, precision: Precision = "float32") -> Tensor:
    """Return the class-balanced cross-entropy of all cells of the crops, plus ``ranking`` times their ranking loss."""
    transformed = TransformedNet.of(net) if is_transformable(net, precision) else None
    logits = [_logits(net, transformed, crop).float() for crop in crops]
    labels = [crop.labels for crop in crops]
    cells = torch.cat([each.permute(1, 0, 2, 3).reshape(2, -1) for each in logits], 1)
    total = balanced_cross_entropy(cells, torch.cat([each.reshape(-1) for each in labels]))
    return total + ranking * ranking_loss(logits, labels) if ranking else total


def ranking_loss(logits: Sequence[Tensor], labels: Sequence[Tensor]) -> Tensor:
    """Return the mean over pixels of ``-log(sum over matches of e^s / sum over labelled cells of e^s)``.

    ``s`` is the log-odds of a match. A pixel without a match or without a mismatch teaches nothing; without
    any other pixel the loss is 0.

    Args:
        logits: of each crop (slot, 2, y, x).
        labels: of each crop int64 (slot, y, x): 0 match, 1 mismatch, ``IGNORED``.
    """
    losses = [logits[0].sum() * 0]
    for given, label in zip(logits, labels, strict=True):
        taught = (label == 0).any(0) & (label == 1).any(0)
        score, kind = (given[:, 0] - given[:, 1])[:, taught], label[:, taught]  # slot pixel
        matches = score.masked_fill(kind != 0, -torch.inf).logsumexp(0)
        losses.append((score.masked_fill(kind == IGNORED, -torch.inf).logsumexp(0) - matches).reshape(-1))
    values = torch.cat([losses[0].reshape(1), *losses[1:]])
    return values.sum() / max(len(values) - 1, 1)


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
