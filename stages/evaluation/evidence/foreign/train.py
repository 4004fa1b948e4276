"""Training the net that scores foreign maps, on crops of the training scenes' maps by several matchers."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semidense.stages.evaluation.evidence.declaration import REACH, EvidenceSamples
from semidense.stages.evaluation.evidence.foreign.declaration import (
    FEATURES,
    OF_CELLS,
    ForeignNetParams,
    ForeignSamples,
    OfForeignSamples,
)
from semidense.stages.evaluation.evidence.loss import crop_loss
from semidense.stages.evaluation.evidence.net import EvidenceNet
from semidense.stages.evaluation.samples import UNKNOWN
from semidense.stages.learning.parameters import initialise, to_vector
from semidense.stages.learning.scenes import Scenes
from semidense.stages.learning.schedule import SHARDS
from semidense.stages.learning.training import fit
from semidense.stages.stage import Monitor, Network, Silent, by_scene


def train_foreign_net(params: ForeignNetParams, inputs: OfForeignSamples, monitor: Monitor | None = None) -> Network:
    """Train the net from nothing; its answer is the log-odds of a right disparity in the training scenes' maps.

    Each scene counts the same. Half of the crops are turned upside down. A share of them is shown without what the
    right view says, so that one net scores maps with and without it.

    Args:
        params: schedule, and that share.
        inputs: ``foreign_samples`` of every training scene.
        monitor: progress and checkpoints.

    Returns:
        ``parameters`` float32 (parameter,) and ``loss`` float32 (step,).
    """
    samples = by_scene(inputs["foreign_samples"], "foreign_samples")
    scenes = Scenes(lambda number: _Scene.of(samples[number], params.tolerance), len(samples))
    net = EvidenceNet(len(FEATURES))
    initialise(net, params.seed)
    seen = torch.from_numpy(np.concatenate([scenes[number].pixels() for number in range(len(scenes))]))
    net.keep(seen.mean(dim=0), seen.std(dim=0, correction=0))

    def loss(step: int, shard: int) -> Tensor:
        rng = np.random.default_rng((params.seed, step, shard))
        crops = [scenes[int(rng.integers(len(scenes)))].crop(rng) for _ in range(params.batch // SHARDS)]
        for crop in crops[: round(params.blind * len(crops))]:
            crop["features"][-len(OF_CELLS) :] = 0
        return torch.stack([crop_loss(net, crop) for crop in crops]).mean()

    curve = fit(net, loss, params, monitor or Silent())
    return {"parameters": to_vector(net), "loss": curve}


@dataclass(frozen=True)
class _Scene:
    """The crops of a training scene, in memory.

    Attributes:
        features: (crop, feature, seen, column) float16.
        right: (crop, row, column) int8: 1 right, 0 wrong, -1 unknown.
    """

    features: NDArray[np.floating]
    right: NDArray[np.int8]

    @classmethod
    def of(cls, samples: ForeignSamples, tolerance: float) -> "_Scene":
        error = samples["error"]
        right = np.where(np.isnan(error), np.int8(UNKNOWN), (error <= tolerance).astype(np.int8))
        return cls(samples["features"], right)

    @property
    def nbytes(self) -> int:
        """How much memory the scene takes."""
        return self.features.nbytes + self.right.nbytes

    def pixels(self) -> NDArray[np.float32]:
        """Return some judged pixels of every crop: (pixel, feature)."""
        sparse = (slice(None), slice(None, None, 8), slice(None, None, 8))
        known = np.moveaxis(self.features[:, :, REACH:-REACH], 1, -1)[sparse]
        judged: NDArray[np.float32] = known[self.right[sparse] != UNKNOWN].astype(np.float32)
        return judged

    def crop(self, rng: np.random.Generator) -> EvidenceSamples:
        """Return a random crop, upside down in half of the cases: that changes no meaning."""
        chosen, turn = int(rng.integers(len(self.right))), -1 if rng.random() < 0.5 else 1
        seen, right = self.features[chosen, :, ::turn], self.right[chosen, ::turn]
        return {"features": seen.astype(np.float32), "right": right.copy()}
