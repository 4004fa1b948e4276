"""Training the matching-Net on crops or patches of the training scenes.

The two forms of samples are the same objective: cross-entropy with both classes of equal weight.
``dense`` computes conv1 and conv2 once a crop and compares it at several disparities, which is over
a hundred times the samples a second of the paper's way.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from stages.augmentation import relight
from stages.matching.declaration import RADIUS, MatchingNetParams
from stages.matching.net import MatchingNet
from stages.parameters import initialise, to_vector
from stages.precision import autocast
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
            return balanced_loss(net, crops)

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


def balanced_loss(net: MatchingNet, crops: Sequence[Crop]) -> Tensor:
    """Return the cross-entropy of all cells of the crops, matches and mismatches weighing the same."""
    logits = torch.cat([_logits(net, crop).permute(1, 0, 2, 3).reshape(2, -1) for crop in crops], 1)
    labels = torch.cat([crop.labels.reshape(-1) for crop in crops])
    return balanced_cross_entropy(logits, labels)


def _logits(net: MatchingNet, crop: Crop) -> Tensor:
    """Return the logits (slot, 2, h, w) of a crop at each of its disparities."""
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
