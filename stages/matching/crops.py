"""Crops of the training scenes and the losses over their cells: what the networks that compare views learn from.

The paper's objective is the cross-entropy of match and mismatch, both classes weighing the same. It judges each cell
alone, while the winner is taken among the cells of a pixel, and after some hundred steps nearly all mismatches are told
easily. The *ranking loss* adds what is left to learn: the negative log of the match's share in the softmax over
a pixel's disparities, whose gradient goes to the mismatches that rival it.
"""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semidense.stages.learning.augmentation import relight
from semidense.stages.learning.scenes import Scenes
from semidense.stages.learning.training import balanced_cross_entropy
from semidense.stages.matching.declaration import RADIUS, MatchingSamples
from semidense.stages.matching.samples import ABSENT

IGNORED = -1
Channels = Sequence[NDArray[np.float32]] | Scenes[NDArray[np.float32]]
"""The channels of each training scene: float32 (view, channel, y, x)."""


class Scaled(Protocol):
    """A network that brings its channels to one scale."""

    input_mean: Tensor
    input_std: Tensor


def measure_channels(net: Scaled, scenes: Channels) -> None:
    """Give the net the mean and the standard deviation of each channel over the training scenes."""
    moments = [_moments(scenes[number]) for number in range(len(scenes))]
    means, squares = np.mean([mean for mean, _ in moments], 0), np.mean([square for _, square in moments], 0)
    net.input_mean.copy_(torch.from_numpy(means))
    net.input_std.copy_(torch.from_numpy(np.sqrt(np.maximum(squares - means**2, 1e-8))))


def _moments(scene: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean of each channel of a scene and that of its squares."""
    mean: NDArray[np.float64] = scene.mean((0, 2, 3), dtype=np.float64)
    return mean, np.square(scene, dtype=np.float64).mean((0, 2, 3))


class Crop:
    """One sample, cut out: the left crop, the strip of the right view that its disparities reach, the labels."""

    def __init__(self, left: Tensor, strip: Tensor, starts: NDArray[np.int64], labels: Tensor) -> None:
        self.left = left  # 1 l h+2r w+2r, of the context r
        self.strip = strip  # 1 l h+2r w+2r+span
        self.starts = starts  # slot: column of the strip at which a slot's right crop begins
        self.labels = labels  # slot h w: 0 match, 1 mismatch, IGNORED


def cut_crop(
    samples: MatchingSamples,
    index: int,
    scenes: Channels,
    strength: float,
    rng: np.random.Generator,
    slots: NDArray[np.int32] | None = None,
    radius: int = RADIUS,
) -> Crop:
    """Cut one sample out of its scene, with another light on each view.

    Args:
        samples: arrays as ``draw_samples`` makes them.
        index: the sample.
        scenes: float32 (view, channel, y, x) of each training scene. Beyond an image comes its nearest pixel.
        strength: of the random lighting; 0 for none.
        rng: source of that lighting.
        slots: disparities to compare it at, px; None for those of the sample.
        radius: context that the network needs on each side, px.
    """
    views = scenes[int(samples["scene"][index])]
    if samples["mirrored"][index]:
        views = views[::-1, :, :, ::-1]
    truth = samples["truth"][index]
    if slots is None:
        slots = samples["disparities"][index]
        slots = slots[slots != ABSENT]
    y, x = int(samples["y"][index]), int(samples["x"][index])
    rows = np.arange(y - radius, y + truth.shape[0] + radius)
    columns = np.arange(x - radius, x + truth.shape[1] + radius)
    reach = np.arange(columns[0] - slots.max(), columns[-1] - slots.min() + 1)
    left = relight(cut(views[0], rows, columns), strength, rng)
    strip = relight(cut(views[1], rows, reach), strength, rng)
    labels = label_cells(truth, slots, x, views.shape[3])
    return Crop(to_tensor(left), to_tensor(strip), (slots.max() - slots).astype(np.int64), torch.from_numpy(labels))


def cut(view: NDArray[np.float32], rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return rows and columns of a view; beyond the image the nearest pixel, as in the cost volume."""
    height, width = view.shape[1:]
    return view[:, np.clip(rows, 0, height - 1)[:, None], np.clip(columns, 0, width - 1)]


def to_tensor(view: NDArray[np.float32]) -> Tensor:
    """Return a view (channel, y, x) as a batch of one, as the networks take it."""
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


def cells_loss(logits: Sequence[Tensor], labels: Sequence[Tensor], ranking: float) -> Tensor:
    """Return the class-balanced cross-entropy of all cells of the crops, plus ``ranking`` times their ranking loss.

    Args:
        logits: of each crop (slot, 2, y, x).
        labels: of each crop int64 (slot, y, x): 0 match, 1 mismatch, ``IGNORED``.
        ranking: weight of the ranking loss; 0: none.
    """
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
