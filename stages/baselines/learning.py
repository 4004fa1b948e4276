"""What the learnt confidence baselines learn from: pixels of the raw maps of the training scenes, right or wrong."""

from collections.abc import Sequence
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from semidense.stages.evaluation.samples import UNKNOWN, label_pixels
from semidense.stages.stage import DisparityMap, StageError, Truth, by_scene


class OfScenes(TypedDict):
    """The raw map and the truth of every training scene."""

    disparity: Sequence[DisparityMap]
    truth: Sequence[Truth]


def labelled_scenes(inputs: OfScenes, tolerance: float) -> list[tuple[NDArray[np.float32], NDArray[np.int8]]]:
    """Return the raw map and the labels of every training scene: 1 right, 0 wrong, -1 unknown.

    A pixel without a disparity is unknown here: these measures look at nothing but disparities.

    Raises:
        StageError: if no training scene has a pixel with a known disparity and a known truth.
    """
    pairs = zip(by_scene(inputs["disparity"], "disparity"), by_scene(inputs["truth"], "truth"), strict=True)
    scenes = []
    for raw, truth in pairs:
        labels = label_pixels(raw["disparity"], truth["disparity"], tolerance)
        scenes.append((raw["disparity"], np.where(np.isfinite(raw["disparity"]), labels, np.int8(UNKNOWN))))
    if all((labels == UNKNOWN).all() for _, labels in scenes):
        raise StageError("no training scene has a pixel with a known disparity")
    return scenes


def draw_pixels(labels: list[NDArray[np.int8]], samples: int, seed: int) -> list[tuple[NDArray[Any], NDArray[Any]]]:
    """Return rows and columns of labelled pixels at random, at most ``samples`` over the scenes in equal parts."""
    rng = np.random.default_rng(seed)
    share = -(-samples // len(labels))
    known = (np.argwhere(label != UNKNOWN) for label in labels)
    chosen = (places[rng.permutation(len(places))[:share]] for places in known)
    return [(places[:, 0], places[:, 1]) for places in chosen]
