"""Whether a map fits two views as they were read, or would fit better upside down, in another scale or sign.

What a disparity leads to looks like its pixel. That is true for any matcher's map, and for a misread one it is not: on
the training scenes another reading made the views differ at least as much as the map did, most of them twice as much.
Without the right view nothing of the kind holds: a noisy map's steps lie on the view's edges no better than elsewhere.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

CLOSER = 0.7
"""Share of the views' difference that another reading must leave before the map as it is is doubted."""
LARGEST = 20.0
"""Differences beyond it count alike, gray levels."""
_FACTORS = {
    "are twice as large": 2,
    "are half as large": 0.5,
    "are 16 times smaller": 1 / 16,
    "have the other sign": -1,
}
_Map = NDArray[np.float32]


def misreading(left: NDArray[np.uint8], right: NDArray[np.uint8], disparity: _Map) -> str | None:
    """Return a line that says how a map was misread; None if it fits best as it is.

    Args:
        left: (y, x) uint8 gray.
        right: (y, x) uint8 gray.
        disparity: (y, x) float32, px, NaN: none.
    """
    slopes = [np.gradient(view.astype(np.float32), axis=1) for view in (left, right)]
    own = _difference(slopes[0], slopes[1], disparity)
    others = {told: _difference(slopes[0], slopes[1], other) for told, other in _other_readings(disparity)}
    others["it belongs to the right view"] = _difference(slopes[1], slopes[0], -disparity)
    others["left and right are exchanged"] = _difference(slopes[1], slopes[0], disparity)
    told = min(others, key=lambda each: others[each])
    if not others[told] < CLOSER * own:
        return None
    return (
        f"the map does not fit the right view as it was read; the views differ {100 * (1 - others[told] / own):.0f} % "
        f"less if {told}"
    )


def _other_readings(disparity: _Map) -> Iterator[tuple[str, _Map]]:
    """Yield other readings of a map, and what each takes it for."""
    yield "it is turned upside down", disparity[::-1]
    yield "it is mirrored", disparity[:, ::-1]
    yield "it is turned by 180 degrees", disparity[::-1, ::-1]
    if disparity.shape[0] == disparity.shape[1]:
        yield "it is transposed", disparity.T
    for told, factor in _FACTORS.items():
        yield f"it is read so that its disparities {told}", disparity * np.float32(factor)


def _difference(view: _Map, other: _Map, disparity: _Map) -> float:
    """Return the mean difference between a view's slopes and those that its disparities lead to.

    A disparity that leads out of the other view counts as the largest difference.
    """
    rows, columns = np.nonzero(np.isfinite(disparity))
    landing = np.rint(columns - disparity[rows, columns]).astype(np.intp)
    inside = (landing >= 0) & (landing < view.shape[1])
    rows, columns, landing = rows[inside], columns[inside], landing[inside]
    total: np.float64 = np.minimum(np.abs(view[rows, columns] - other[rows, landing]), LARGEST).sum(dtype=np.float64)
    count = int(inside.size)
    return (float(total) + LARGEST * (count - len(rows))) / max(1, count)
