"""Training samples of the evaluation-Net: which pixels of the raw maps to look at, and which of them are right.

A sample is a grid of pixels 16 px apart, as a pooled network answers at once. Both forms of training
are of this kind: ``strided`` takes a grid of many pixels at a random place; ``patch``, the paper's way,
takes single pixels, all mismatches of a scene and as many of its matches.
"""

import numpy as np
from numpy.typing import NDArray

from stages.evaluation.declaration import STRIDE, EvaluationSamplesParams
from stages.stage import Arrays, Inputs, StageError, by_scene

UNKNOWN = -1
"""Label of a pixel whose truth is not known, or that lies outside the image."""


def label_pixels(disparity: NDArray[np.float32], truth: NDArray[np.float32], tolerance: float) -> NDArray[np.int8]:
    """Return int8 (y, x): 1 where a disparity is right, 0 where it is wrong or missing, ``UNKNOWN`` without a truth."""
    right = np.abs(disparity - truth) <= tolerance  # NaN compares false: no disparity is wrong
    return np.where(np.isfinite(truth), right, UNKNOWN).astype(np.int8)


def draw_samples(params: EvaluationSamplesParams, inputs: Inputs) -> dict[str, NDArray[np.generic]]:
    """Draw the samples of all training scenes, in random order.

    Returns:
        ``scene``, ``y``, ``x`` int32 (sample,): the grid's first pixel; ``labels`` int8 (sample, row, column):
        1 right, 0 wrong, -1 unknown.

    Raises:
        StageError: if no scene has a pixel with a known truth, or, for ``patch``, none has a wrong one.
    """
    rng = np.random.default_rng(params.seed)
    pairs = zip(by_scene(inputs, "disparity"), by_scene(inputs, "truth"), strict=True)
    labels = [_labels(disparity, truth, params.tolerance) for disparity, truth in pairs]
    if all((label == UNKNOWN).all() for label in labels):
        raise StageError("no training scene has a pixel with a known disparity")
    places = _patches(labels, rng) if params.form == "patch" else _grids(params, labels, rng)
    shape = (1, 1) if params.form == "patch" else (params.rows, params.columns)
    grids = [_grid(labels[scene], y, x, shape) for scene, y, x in places]
    scene, y, x = places.T.astype(np.int32)
    return {"scene": scene, "y": y, "x": x, "labels": np.stack(grids)}


def _labels(disparity: Arrays, truth: Arrays, tolerance: float) -> NDArray[np.int8]:
    return label_pixels(disparity["disparity"], truth["disparity"], tolerance)


def _grids(
    params: EvaluationSamplesParams, labels: list[NDArray[np.int8]], rng: np.random.Generator
) -> NDArray[np.int64]:
    """Return (scene, y, x) of grids at random places that reach over the image as little as they must."""
    span = STRIDE * (np.array((params.rows, params.columns)) - 1) + 1
    scenes = rng.permutation(np.arange(params.samples) % len(labels))
    # A grid larger than the image still starts anywhere in its first 16 pixels, so that every offset is learnt.
    spare = np.array([np.maximum(np.array(labels[scene].shape) - span + 1, STRIDE) for scene in scenes])
    return np.column_stack([scenes, rng.integers(0, spare)])


def _patches(labels: list[NDArray[np.int8]], rng: np.random.Generator) -> NDArray[np.int64]:
    """Return (scene, y, x) of all wrong pixels and as many right ones of each scene, in random order."""
    places = []
    for scene, label in enumerate(labels):
        wrong, right = np.argwhere(label == 0), np.argwhere(label == 1)
        chosen = np.concatenate([wrong, right[rng.permutation(len(right))[: len(wrong)]]])
        places.append(np.column_stack([np.full(len(chosen), scene), chosen]))
    if not any(map(len, places)):
        raise StageError("no training scene has a wrong disparity to learn from: use the form 'strided'")
    return rng.permutation(np.concatenate(places))


def _grid(labels: NDArray[np.int8], y: int, x: int, shape: tuple[int, int]) -> NDArray[np.int8]:
    """Return the labels of a grid that starts at (y, x); ``UNKNOWN`` beyond the image."""
    grid = np.full(shape, UNKNOWN, np.int8)
    found = labels[y::STRIDE, x::STRIDE][: shape[0], : shape[1]]
    grid[: found.shape[0], : found.shape[1]] = found
    return grid
