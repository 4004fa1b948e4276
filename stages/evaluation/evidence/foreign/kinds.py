"""The kinds of maps that the confidence of foreign maps learns from: of several matchers, checked, filled, smoothed."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, median_filter

from semidense.stages.disparity.filling import fill_holes
from semidense.stages.evaluation.evidence.foreign.declaration import KINDS, MATCHERS

BLUR = 2.0
"""Standard deviation by which a map is blurred, px: some networks blur the edges of a surface."""
MEDIAN = 9
"""Side of the median that smooths a map and leaves its edges, px: others do not."""


def kinds_of(maps: Mapping[str, Any]) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """Yield each of ``KINDS`` and its map, (y, x) float32, px, NaN: none.

    Args:
        maps: the products of one scene, by name: those of ``MATCHERS`` with ``dense`` and ``disparity``, and
            ``aggregated`` with ``disparity``.
    """
    made = [maps[matcher]["dense"] for matcher in MATCHERS]
    for matcher in ("sgm", "mc_cnn"):
        checked = maps[matcher]["disparity"]
        made += [checked, fill_holes(checked)]
    summed = maps["aggregated"]["disparity"]
    made += [summed, np.rint(summed), smoothed(fill_holes(summed)), blurred(fill_holes(summed))]
    yield from zip(KINDS, made, strict=True)


def smoothed(disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the median over 9 x 9 px, blurred by 1 px where its surface is smooth: as a network's map, edges sharp."""
    made = median_filter(disparity, MEDIAN, mode="nearest")
    soft = gaussian_filter(made, 1, mode="nearest")
    smooth: NDArray[np.float32] = np.where(np.abs(soft - made) < 1, soft, made)
    return smooth


def blurred(disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the map blurred by a Gaussian of 2 px, edges too."""
    made: NDArray[np.float32] = gaussian_filter(disparity, BLUR, mode="nearest")
    return made
