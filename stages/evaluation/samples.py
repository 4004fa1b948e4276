"""Training samples of the evaluation-Net: which pixels of the raw maps to look at, and which of them are right.

A sample is a grid of pixels 16 px apart, as a pooled network answers at once. Both forms of training
are of this kind: ``strided`` takes a grid of many pixels at a random place; ``patch``, the paper's way,
takes single pixels, all mismatches of a map and as many of its matches.

The maps are the left views' and, where the right view has ground truth, the right views' too, *mirrored*:
of the pair with its views flipped and exchanged, the left one. They come from the same volumes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semidense.stages.evaluation.declaration import STRIDE, EvaluationSamples, EvaluationSamplesParams, LabelledMaps
from semidense.stages.stage import StageError, by_scene

UNKNOWN = -1
"""Label of a pixel whose truth is not known, or that lies outside the image."""


def label_pixels(disparity: NDArray[np.float32], truth: NDArray[np.float32], tolerance: float) -> NDArray[np.int8]:
    """Return int8 (y, x): 1 where a disparity is right, 0 where it is wrong or missing, ``UNKNOWN`` without a truth."""
    right = np.abs(disparity - truth) <= tolerance  # NaN compares false: no disparity is wrong
    return np.where(np.isfinite(truth), right, UNKNOWN).astype(np.int8)


def draw_samples(params: EvaluationSamplesParams, inputs: LabelledMaps) -> EvaluationSamples:
    """Draw the samples of all training scenes, in random order.

    Returns:
        ``scene`` int32, ``mirrored`` bool, ``y`` and ``x`` int32 (sample,): the grid's first pixel;
        ``labels`` int8 (sample, row, column): 1 right, 0 wrong, -1 unknown.

    Raises:
        StageError: if no scene has a pixel with a known truth, or, for ``patch``, none has a wrong one.
    """
    rng = np.random.default_rng(params.seed)
    maps = _maps(params, inputs)
    if all((each.labels == UNKNOWN).all() for each in maps):
        raise StageError("no training scene has a pixel with a known disparity")
    places = _patches(maps, rng) if params.form == "patch" else _grids(params, maps, rng)
    shape = (1, 1) if params.form == "patch" else (params.rows, params.columns)
    chosen, y, x = places.T
    return {
        "scene": np.array([maps[index].scene for index in chosen], np.int32),
        "mirrored": np.array([maps[index].mirrored for index in chosen]),
        "y": y.astype(np.int32),
        "x": x.astype(np.int32),
        "labels": np.stack([_grid(maps[index].labels, row, column, shape) for index, row, column in places]),
    }


@dataclass(frozen=True)
class _Map:
    """A raw map to learn from: whose it is, and int8 (y, x) which of its pixels are right."""

    scene: int
    mirrored: bool
    labels: NDArray[np.int8]


def _maps(params: EvaluationSamplesParams, inputs: LabelledMaps) -> list[_Map]:
    """Return the left view's map of each scene, and the right view's, mirrored, if its truth is known."""
    scenes = by_scene(inputs["disparity"], "disparity"), inputs["right_disparity"], inputs["truth"]
    found = []
    for scene, (left, right, truth) in enumerate(zip(*scenes, strict=True)):
        found.append(_Map(scene, False, label_pixels(left["disparity"], truth["disparity"], params.tolerance)))
        if params.mirror and np.isfinite(truth["right_disparity"]).any():
            labels = label_pixels(right["disparity"], truth["right_disparity"], params.tolerance)
            found.append(_Map(scene, True, labels[:, ::-1]))
    return found


def _grids(params: EvaluationSamplesParams, maps: Sequence[_Map], rng: np.random.Generator) -> NDArray[np.int64]:
    """Return (map, y, x) of grids at random places that reach over the image as little as they must."""
    span = STRIDE * (np.array((params.rows, params.columns)) - 1) + 1
    chosen = rng.permutation(np.arange(params.samples) % len(maps))
    # A grid larger than the image still starts anywhere in its first 16 pixels, so that every offset is learnt.
    spare = np.array([np.maximum(np.array(maps[index].labels.shape) - span + 1, STRIDE) for index in chosen])
    return np.column_stack([chosen, rng.integers(0, spare)])


def _patches(maps: Sequence[_Map], rng: np.random.Generator) -> NDArray[np.int64]:
    """Return (map, y, x) of all wrong pixels and as many right ones of each map, in random order."""
    places = []
    for index, each in enumerate(maps):
        wrong, right = np.argwhere(each.labels == 0), np.argwhere(each.labels == 1)
        chosen = np.concatenate([wrong, right[rng.permutation(len(right))[: len(wrong)]]])
        places.append(np.column_stack([np.full(len(chosen), index), chosen]))
    if not any(map(len, places)):
        raise StageError("no training scene has a wrong disparity to learn from: use the form 'strided'")
    return rng.permutation(np.concatenate(places))


def _grid(labels: NDArray[np.int8], y: int, x: int, shape: tuple[int, int]) -> NDArray[np.int8]:
    """Return the labels of a grid that starts at (y, x); ``UNKNOWN`` beyond the image."""
    grid = np.full(shape, UNKNOWN, np.int8)
    found = labels[y::STRIDE, x::STRIDE][: shape[0], : shape[1]]
    grid[: found.shape[0], : found.shape[1]] = found
    return grid
