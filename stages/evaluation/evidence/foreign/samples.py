"""Samples of foreign maps: what is known of single pixels, and by how much their disparities are wrong."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.foreign.cells import Described, described
from semidense.stages.evaluation.evidence.foreign.declaration import ForeignSamples, ForeignSamplesParams, Sampled
from semidense.stages.evaluation.evidence.foreign.features import features
from semidense.stages.evaluation.evidence.foreign.kinds import kinds_of
from semidense.stages.stage import Array, Images, Network


def draw_foreign_samples(params: ForeignSamplesParams, inputs: Sampled) -> ForeignSamples:
    """Draw pixels of every kind of map of a scene; hidden pixels too, since a map answers for those as well.

    Returns:
        ``features`` float32 (sample, feature), ``error`` float32 (sample,) px, ``kind`` int8 (sample,).
    """
    rng = np.random.default_rng(params.seed)
    height = len(inputs["images"]["left"])
    rows = min(params.rows, height)
    strip = _Strip.of(params, inputs, int(rng.integers(0, height - rows + 1)), rows)
    drawn = [strip.drawn(rng, params, disparity) for _, disparity in kinds_of(inputs)]
    return {
        "features": np.concatenate([known for known, _ in drawn]),
        "error": np.concatenate([error for _, error in drawn]),
        "kind": np.repeat(np.arange(len(drawn), dtype=np.int8), [len(error) for _, error in drawn]),
    }


@dataclass(frozen=True)
class _Strip:
    """Some rows of a scene: what all its maps have in common."""

    top: int
    rows: int
    images: Images
    views: Described
    evaluation_net: Network
    truth: NDArray[np.float32]

    @classmethod
    def of(cls, params: ForeignSamplesParams, inputs: Sampled, top: int, rows: int) -> "_Strip":
        channels = _block(inputs["channels"]["channels"], top, rows, 2)
        images: Images = {**inputs["images"], "left": _block(inputs["images"]["left"], top, rows, 0)}
        views = described(channels, inputs["descriptor_net"], params.precision)
        return cls(top, rows, images, views, inputs["evaluation_net"], inputs["truth"]["disparity"][top : top + rows])

    def drawn(
        self, rng: np.random.Generator, params: ForeignSamplesParams, disparity: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Draw pixels that have a disparity and a truth: their features and errors."""
        block = _block(disparity, self.top, self.rows, 0)
        known = features(self.images, block, self.evaluation_net, self.views.costs(block), params.precision)
        error = np.abs(disparity[self.top : self.top + self.rows] - self.truth).ravel()
        judged = np.flatnonzero(np.isfinite(error))
        chosen = rng.choice(judged, min(params.pixels, judged.size), replace=False)
        return known.reshape(len(known), -1)[:, chosen].T, error[chosen]


def _block(array: Array, top: int, rows: int, axis: int) -> Array:
    """Return rows with 50 px of context all round; beyond the image lies the nearest pixel, as in a tile."""
    for at, first, count in ((axis, top, rows), (axis + 1, 0, array.shape[axis + 1])):
        array = array.take(np.arange(first - RADIUS, first + count + RADIUS), axis=at, mode="clip")
    return array
