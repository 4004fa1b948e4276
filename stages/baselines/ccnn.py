"""CCNN: a small network that judges a disparity by the 9 x 9 px of the raw map around it.

Source: Poggi & Mattoccia, "Learning from scratch a confidence measure", BMVC 2016.
"""

from typing import TypedDict

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from semidense.stages.baselines.declaration import CCNN_RADIUS, CcnnParams, Scored
from semidense.stages.baselines.learning import OfScenes, labelled_scenes
from semidense.stages.compute.threads import one_thread
from semidense.stages.evaluation.net import DISPARITY_UNIT
from semidense.stages.evaluation.samples import UNKNOWN
from semidense.stages.learning.parameters import from_vector, initialise, to_vector
from semidense.stages.learning.schedule import SHARDS
from semidense.stages.learning.training import balanced_cross_entropy, fit
from semidense.stages.stage import DisparityMap, Monitor, Network, NoParams, Silent


class Ccnn(nn.Module):
    """Four convolutions of 3 x 3 take a patch to one place, three of 1 x 1 judge it; nothing is padded."""

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(1, 64, 3)
        self.conv2 = nn.Conv2d(64, 64, 3)
        self.conv3 = nn.Conv2d(64, 64, 3)
        self.conv4 = nn.Conv2d(64, 64, 3)
        self.fc1 = nn.Conv2d(64, 100, 1)
        self.fc2 = nn.Conv2d(100, 100, 1)
        self.out = nn.Conv2d(100, 2, 1)

    def forward(self, disparity: Tensor) -> Tensor:
        """Return the logits of wrong and right: (B, 1, y + 8, x + 8) -> (B, 2, y, x)."""
        for layer in (self.conv1, self.conv2, self.conv3, self.conv4, self.fc1, self.fc2):
            disparity = functional.relu(layer(disparity))
        logits: Tensor = self.out(disparity)
        return logits


def train_ccnn(params: CcnnParams, inputs: OfScenes, monitor: Monitor | None = None) -> Network:
    """Train a CCNN from nothing on random crops of the training scenes' raw maps.

    Returns:
        ``parameters`` float32 (parameter,) and ``loss`` float32 (step,).

    Raises:
        StageError: if no training scene has a labelled pixel.
    """
    margin = CCNN_RADIUS
    scenes = [
        (np.pad(np.nan_to_num(disparity), margin, mode="edge"), labels)
        for disparity, labels in labelled_scenes(inputs, params.tolerance)
    ]
    net = Ccnn().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    initialise(net, params.seed)

    def loss(step: int, shard: int) -> Tensor:
        rng = np.random.default_rng((params.seed, step, shard))
        maps, labels = zip(*(_crop(scenes, params.crop, rng) for _ in range(params.batch // SHARDS)), strict=True)
        logits = net(_layer(np.stack(maps)))
        targets = torch.from_numpy(np.stack(labels).astype(np.int64))
        return balanced_cross_entropy(logits.permute(1, 0, 2, 3).reshape(2, -1), targets.reshape(-1))

    curve = fit(net, loss, params, monitor or Silent())
    return {"parameters": to_vector(net), "loss": curve}


def _crop(
    scenes: list[tuple[NDArray[np.float32], NDArray[np.int8]]], side: int, rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.int8]]:
    """Return a random crop of a random scene with its context, and its labels; unknown beyond the image."""
    padded, labels = scenes[rng.integers(len(scenes))]
    y, x = (int(rng.integers(max(length - side, 0) + 1)) for length in labels.shape)
    found = labels[y : y + side, x : x + side]
    crop = padded[y : y + side + 2 * CCNN_RADIUS, x : x + side + 2 * CCNN_RADIUS]
    missing = [(0, side - length) for length in found.shape]
    return np.pad(crop, missing), np.pad(found, missing, constant_values=UNKNOWN)


def _layer(maps: NDArray[np.float32]) -> Tensor:
    """Return maps (B, y, x) as the network's input (B, 1, y, x), in the unit of the evaluation-Net."""
    return torch.from_numpy(maps[:, None] / np.float32(DISPARITY_UNIT)).contiguous(memory_format=torch.channels_last)


class OfNetwork(TypedDict):
    """The raw map and the network that scores it."""

    disparity: DisparityMap
    ccnn_net: Network


@one_thread()
def compute_ccnn(_: NoParams, inputs: OfNetwork) -> Scored:
    """Compute the product ``ccnn`` of a block that brings 4 px of context on every side."""
    net = Ccnn()
    from_vector(net, inputs["ccnn_net"]["parameters"])
    net = net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    with torch.inference_mode():
        logits = net(_layer(np.nan_to_num(inputs["disparity"]["disparity"])[None]))[0]
    return {"confidence": torch.sigmoid(logits[1] - logits[0]).numpy()}
