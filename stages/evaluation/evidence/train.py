"""Training the net that weighs the evidence, on crops of the training scenes' maps."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semidense.stages.evaluation.evidence.contradiction import contradict, donors_of
from semidense.stages.evaluation.evidence.declaration import (
    REACH,
    EvidenceNetParams,
    EvidenceSamples,
    OfEvidenceSamples,
)
from semidense.stages.evaluation.evidence.features import NAMES
from semidense.stages.evaluation.evidence.loss import crop_loss
from semidense.stages.evaluation.evidence.net import EvidenceNet
from semidense.stages.evaluation.samples import UNKNOWN
from semidense.stages.learning.parameters import initialise, to_vector
from semidense.stages.learning.scenes import Scenes
from semidense.stages.learning.schedule import SHARDS
from semidense.stages.learning.training import fit
from semidense.stages.stage import Monitor, Network, Silent, by_scene

SEEN = 4000
"""Judged pixels of each scene by which the inputs are measured and bad evidence is found."""


def train_evidence_net(params: EvidenceNetParams, inputs: OfEvidenceSamples, monitor: Monitor | None = None) -> Network:
    """Train the net from nothing; its answer is the log-odds of a right disparity in the training scenes.

    It learns from crops around random pixels that are judged; each scene counts the same. Half of the crops are turned
    upside down, and regions of some contradict themselves; see ``contradiction``.

    Args:
        params: schedule, the crops, and how often evidence contradicts itself.
        inputs: ``evidence_samples`` of every training scene.
        monitor: progress and checkpoints.

    Returns:
        ``parameters`` float32 (parameter,) and ``loss`` float32 (step,).
    """
    samples = by_scene(inputs["evidence_samples"], "evidence_samples")
    scenes = Scenes(lambda number: _Scene.of(samples[number]), len(samples))
    drawn = np.random.default_rng(params.seed)
    seen = [scenes[number].pixels(drawn) for number in range(len(scenes))]
    features, right = (np.concatenate(each) for each in zip(*seen, strict=True))
    donors = donors_of(features, right)
    net = EvidenceNet(len(NAMES))
    initialise(net, params.seed)
    net.keep(torch.from_numpy(features.mean(axis=0)), torch.from_numpy(features.std(axis=0)))

    def loss(step: int, shard: int) -> Tensor:
        rng = np.random.default_rng((params.seed, step, shard))
        losses = []
        for _ in range(params.batch // SHARDS):
            crop = scenes[int(rng.integers(len(scenes)))].crop((params.height, params.width), rng)
            losses.append(crop_loss(net, contradict(crop, donors, params.contradicted, rng)))
        return torch.stack(losses).mean()

    curve = fit(net, loss, params, monitor or Silent())
    return {"parameters": to_vector(net), "loss": curve}


@dataclass(frozen=True)
class _Scene:
    """A training scene, in memory.

    Attributes:
        features: (feature, seen, column) float16.
        right: (row, column) int8.
        judged: (pixel,) int32, flat indices of the pixels that are right or wrong.
    """

    features: NDArray[np.floating]
    right: NDArray[np.int8]
    judged: NDArray[np.int32]

    @classmethod
    def of(cls, samples: EvidenceSamples) -> "_Scene":
        right = samples["right"]
        return cls(samples["features"], right, np.flatnonzero(right != UNKNOWN).astype(np.int32))

    @property
    def nbytes(self) -> int:
        """How much memory the scene takes."""
        return self.features.nbytes + self.right.nbytes + self.judged.nbytes

    def pixels(self, rng: np.random.Generator) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Return random judged pixels: features (pixel, feature), and which are right."""
        rows, columns = self._places(rng.integers(0, len(self.judged), SEEN))
        return self.features[:, rows + REACH, columns].T.astype(np.float32), self.right[rows, columns] == 1

    def crop(self, size: tuple[int, int], rng: np.random.Generator) -> EvidenceSamples:
        """Return the crop around a random judged pixel, upside down in half of the cases: that changes no meaning.

        It is smaller than ``size`` where the scene is.
        """
        middle = self._places(rng.integers(0, len(self.judged), 1))
        y, x = (
            int(np.clip(place[0] - side // 2, 0, max(length - side, 0)))
            for place, side, length in zip(middle, size, self.right.shape, strict=True)
        )
        turn = -1 if rng.random() < 0.5 else 1
        seen = self.features[:, y : y + size[0] + 2 * REACH, x : x + size[1]]
        right = self.right[y : y + size[0], x : x + size[1]]
        return {"features": seen[:, ::turn].astype(np.float32), "right": right[::turn].copy()}

    def _places(self, chosen: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        rows, columns = np.divmod(self.judged[chosen].astype(np.int64), self.right.shape[1])
        return rows, columns
