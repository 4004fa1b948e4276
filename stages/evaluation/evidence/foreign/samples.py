"""Samples of foreign maps: what is known of single pixels, and by how much their disparities are wrong."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.foreign.cells import described
from semidense.stages.evaluation.evidence.foreign.declaration import ForeignSamples, ForeignSamplesParams, Sampled
from semidense.stages.evaluation.evidence.foreign.features import features
from semidense.stages.evaluation.evidence.foreign.kinds import kinds_of
from semidense.stages.stage import Images

_AROUND = (RADIUS, RADIUS)


def draw_foreign_samples(params: ForeignSamplesParams, inputs: Sampled) -> ForeignSamples:
    """Draw pixels of every kind of map of a scene; hidden pixels too, since a map answers for those as well.

    They come from the whole of each map: a few rows of a scene are too much alike to learn from.

    Returns:
        ``features`` float32 (sample, feature), ``error`` float32 (sample,) px, ``kind`` int8 (sample,).
    """
    rng = np.random.default_rng(params.seed)
    images: Images = {
        **inputs["images"],
        "left": np.pad(inputs["images"]["left"], (_AROUND, _AROUND, (0, 0)), mode="edge"),
    }
    channels = np.pad(inputs["channels"]["channels"], ((0, 0), (0, 0), _AROUND, _AROUND), mode="edge")
    views = described(channels, inputs["descriptor_net"], params.precision)

    def drawn(disparity: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Draw pixels that have a disparity and a truth: their features and errors."""
        block = np.pad(disparity, RADIUS, mode="edge")
        known = features(images, block, inputs["evaluation_net"], views.costs(block), params.precision)
        error = np.abs(disparity - inputs["truth"]["disparity"]).ravel()
        judged = np.flatnonzero(np.isfinite(error))
        chosen = rng.choice(judged, min(params.pixels, judged.size), replace=False)
        return known.reshape(len(known), -1)[:, chosen].T, error[chosen]

    made = [drawn(disparity) for _, disparity in kinds_of(inputs)]
    return {
        "features": np.concatenate([known for known, _ in made]),
        "error": np.concatenate([error for _, error in made]),
        "kind": np.repeat(np.arange(len(made), dtype=np.int8), [len(error) for _, error in made]),
    }
