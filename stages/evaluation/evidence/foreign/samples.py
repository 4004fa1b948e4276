"""Samples of foreign maps: what is known of the pixels of crops, and by how much their disparities are wrong."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.declaration import REACH
from semidense.stages.evaluation.evidence.foreign.cells import described
from semidense.stages.evaluation.evidence.foreign.declaration import (
    FEATURES,
    ForeignSamples,
    ForeignSamplesParams,
    Sampled,
)
from semidense.stages.evaluation.evidence.foreign.features import features
from semidense.stages.evaluation.evidence.foreign.kinds import kinds_of
from semidense.stages.stage import Images, StageError

_ABOVE, _BESIDE = (RADIUS + REACH, RADIUS + REACH), (RADIUS, RADIUS)


def draw_foreign_samples(params: ForeignSamplesParams, inputs: Sampled) -> ForeignSamples:
    """Draw crops of every kind of map of a scene; hidden pixels too, since a map answers for those as well.

    A crop is smaller than asked for where the scene is.

    Returns:
        ``features`` float16 (crop, feature, seen, column), ``error`` float32 (crop, row, column) px, NaN without a
        disparity or a truth, and ``kind`` int8 (crop,). The first row of ``error`` is row ``REACH`` of ``features``.

    Raises:
        StageError: if a map has no pixel with both a disparity and a truth.
    """
    rng = np.random.default_rng(params.seed)
    images: Images = {
        **inputs["images"],
        "left": np.pad(inputs["images"]["left"], (_ABOVE, _BESIDE, (0, 0)), mode="edge"),
    }
    channels = np.pad(inputs["channels"]["channels"], ((0, 0), (0, 0), _ABOVE, _BESIDE), mode="edge")
    views = described(channels, inputs["descriptor_net"], params.precision)
    truth = inputs["truth"]["disparity"]
    height, width = (min(side, length) for side, length in zip((params.height, params.width), truth.shape, strict=True))
    maps = list(kinds_of(inputs))
    made: ForeignSamples = {
        "features": np.empty((len(maps) * params.crops, len(FEATURES), height + 2 * REACH, width), np.float16),
        "error": np.empty((len(maps) * params.crops, height, width), np.float32),
        "kind": np.repeat(np.arange(len(maps), dtype=np.int8), params.crops),
    }
    for kind, (name, disparity) in enumerate(maps):
        block = np.pad(disparity, (_ABOVE, _BESIDE), mode="edge")
        known = features(images, block, inputs["evaluation_net"], views.costs(block), params.precision)
        error = np.abs(disparity - truth)
        for crop, (y, x) in enumerate(_corners(error, (height, width), params.crops, rng, name), kind * params.crops):
            made["features"][crop] = known[:, y : y + height + 2 * REACH, x : x + width]
            made["error"][crop] = error[y : y + height, x : x + width]
    return made


def _corners(
    error: NDArray[np.float32], size: tuple[int, int], count: int, rng: np.random.Generator, name: str
) -> NDArray[np.int64]:
    """Return the first pixels (crop, 2) of crops around random pixels that are judged."""
    judged = np.argwhere(np.isfinite(error))
    if not len(judged):
        raise StageError(f"{name}: no pixel has both a disparity and a truth")
    middle = judged[rng.integers(0, len(judged), count)]
    corners: NDArray[np.int64] = np.clip(middle - np.array(size) // 2, 0, np.array(error.shape) - size)
    return corners
