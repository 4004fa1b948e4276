"""Evidence that contradicts itself: what training scenes hardly hold, painted into their crops.

In training scenes all evidence of a pixel is bad together, or good together. A net that learns from them alone need not
care for each kind of it: it stays sure of a pixel that looks right but for the right view, which says another
disparity. So regions of the crops get one kind of evidence from other pixels, where it is bad. Their disparities count
as right if both pixels' are.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semidense.stages.evaluation.evidence.declaration import EvidenceSamples
from semidense.stages.evaluation.evidence.features import NAMES

SMALLEST = 8
"""Least side of a region, px."""
FEW = 0.01
"""Evidence is bad that is worse than that of all right pixels but this share."""


class Kind(NamedTuple):
    """Numbers that tell the same of a pixel.

    Attributes:
        worst: the one by which pixels are found where this evidence is bad.
        sign: 1 if a large number is bad, -1 if a small one is.
        others: those that are taken over with it.
    """

    worst: str
    sign: int
    others: Sequence[str]


KINDS = (
    Kind("left_right 9", 1, ("left_right", "left_right 25")),
    Kind("aggregated_margin", -1, ("aggregated_margin 9", "aggregated_margin 25", "single_margin")),
    Kind("agrees 9", -1, ("agrees", "agrees 25", "single_excess")),
    Kind("single_minima", 1, ("single_flatness", "aggregated_flatness")),
)


class Donors(NamedTuple):
    """Pixels where a kind of evidence is bad.

    Attributes:
        columns: which of the features are that evidence.
        features: (pixel, column) float32.
        right: (pixel,) whether their disparities are right.
    """

    columns: NDArray[np.intp]
    features: NDArray[np.float32]
    right: NDArray[np.bool_]


def donors_of(features: NDArray[np.float32], right: NDArray[np.bool_]) -> list[Donors]:
    """Find, for each of ``KINDS``, the pixels where it is bad; a kind of which there are none is left out.

    Args:
        features: (pixel, feature) of the training scenes.
        right: (pixel,).
    """
    if not right.any():
        return []
    found = []
    for kind in KINDS:
        told = kind.sign * features[:, NAMES.index(kind.worst)]
        bad = np.flatnonzero(told > np.quantile(told[right], 1 - FEW))
        columns = np.array([NAMES.index(name) for name in (kind.worst, *kind.others)])
        if len(bad):
            found.append(Donors(columns, features[np.ix_(bad, columns)], right[bad]))
    return found


def contradict(
    crop: EvidenceSamples, donors: Sequence[Donors], share: float, rng: np.random.Generator
) -> EvidenceSamples:
    """Return a crop in which, by chance, regions have evidence of donors.

    Args:
        crop: ``features`` (feature, seen, column) float32 and ``right`` (row, column) int8.
        donors: from ``donors_of``.
        share: how probable a region is, for each kind of evidence.
        rng: of the draw.
    """
    features, right = crop["features"].copy(), crop["right"].copy()
    beyond = (features.shape[1] - right.shape[0]) // 2
    for kind in donors:
        if rng.random() >= share:
            continue
        height, width = (int(rng.integers(min(SMALLEST, side), side + 1)) for side in features.shape[1:])
        y, x = (
            int(rng.integers(0, side - part + 1))
            for side, part in zip(features.shape[1:], (height, width), strict=True)
        )
        # One donor for all pixels, or one for each: flat regions, and noisy ones.
        many = (height, width) if rng.random() < 0.5 else (1, 1)
        chosen = rng.integers(0, len(kind.right), many)
        features[kind.columns, y : y + height, x : x + width] = np.moveaxis(kind.features[chosen], -1, 0)
        wrong = np.zeros(features.shape[1:], np.bool_)
        wrong[y : y + height, x : x + width] = ~kind.right[chosen]
        right[wrong[beyond : beyond + len(right)] & (right == 1)] = 0
    return {"features": features, "right": right}
