"""Tell whether a ground truth is of its images: which multiple of it carries the right view onto the left one best.

A truth that is read with the wrong scale, from right to left, or beside the wrong images fits no better than chance.
Views may differ in exposure and lighting, so small patches are compared by their correlation.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.datasets.scene import Scene, Truth

SCALES = (1.0, 0.5, 2.0, -1.0, 0.25, 4.0, 0.9, 1.1)
"""Multiples of the truth that are tried; -1 is its mirror image. The first is the right one."""
_SAMPLES = 20_000
_REACH = 4
"""Pixels that a patch reaches from its centre."""
_FLATTEST = 1e-3
"""Least deviation of a patch, gray levels: the correlation of a flatter one means nothing."""
Gray = NDArray[np.float32]


def fits(scene: Scene, truth: Truth) -> dict[float, float]:
    """Return for each of `SCALES` the mean correlation of left patches with the right ones that it leads to, -1 to 1.

    Some 20,000 pixels spread over the image are looked at, of those that both views see and whose match lies inside
    the right view at the scale 1. A match of another scale outside the view counts as 0. NaN where no pixel is left.
    """
    left, right = _gray(scene.left), _gray(scene.right)
    rows, columns = _samples(truth, left.shape)
    disparity = truth.disparity[rows, columns]
    patches = _patches(left, rows, columns.astype(np.float32))
    return {scale: _mean_correlation(patches, right, rows, columns - scale * disparity) for scale in SCALES}


def best_scale(found: dict[float, float]) -> float:
    """Return the multiple that fits best.

    >>> best_scale({1.0: 0.8, 0.5: 0.1, 2.0: float("nan")})
    1.0
    """
    return max(found, key=lambda scale: -np.inf if np.isnan(found[scale]) else found[scale])


def _gray(image: NDArray[Any]) -> Gray:
    gray: Gray = image.reshape(*image.shape[:2], -1).mean(axis=2, dtype=np.float32)
    return gray


def _samples(truth: Truth, shape: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    inside = truth.nonocc.copy()
    inside[:_REACH] = inside[shape[0] - _REACH :] = False
    inside[:, :_REACH] = inside[:, shape[1] - 1 - _REACH :] = False
    rows, columns = np.nonzero(inside)
    landing = columns - truth.disparity[rows, columns]
    reached = np.flatnonzero((landing >= _REACH) & (landing <= shape[1] - 2 - _REACH))
    chosen = reached[:: max(1, reached.size // _SAMPLES)]
    return rows[chosen], columns[chosen]


def _patches(image: Gray, rows: NDArray[np.intp], centres: Gray) -> Gray:
    """Return the patches around some places, (place, pixel), between two columns by linear interpolation."""
    step = np.arange(-_REACH, _REACH + 1)
    low = np.floor(centres).astype(np.intp)
    part = (centres - low)[:, None, None].astype(np.float32)
    y, x = rows[:, None, None] + step[:, None], low[:, None, None] + step
    found: Gray = image[y, x] * (1 - part) + image[y, x + 1] * part
    return found.reshape(rows.size, step.size**2)


def _mean_correlation(patches: Gray, right: Gray, rows: NDArray[np.intp], landing: Gray) -> float:
    inside = (landing >= _REACH) & (landing <= right.shape[1] - 2 - _REACH)
    if not rows.size:
        return float("nan")
    found = _correlations(patches[inside], _patches(right, rows[inside], landing[inside].astype(np.float32)))
    return float(found.sum() / rows.size)


def _correlations(first: Gray, second: Gray) -> Gray:
    first, second = (each - each.mean(axis=1, keepdims=True) for each in (first, second))
    spread = np.sqrt((first**2).mean(axis=1) * (second**2).mean(axis=1))
    correlation: Gray = np.where(spread > _FLATTEST, (first * second).mean(axis=1) / np.maximum(spread, _FLATTEST), 0)
    return correlation
