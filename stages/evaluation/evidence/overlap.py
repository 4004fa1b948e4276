"""Overlap: where a map hides its own pixels from the right view.

Two pixels of a row that lead to the same column of the right view cannot both be seen there. The one of the larger
disparity is nearer and hides the other: it is occluded, or one of the two is wrong. The left view's map tells so alone.
"""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.stage import require_shape

LARGEST = 100.0
"""Overlap of a pixel that leads outside the right view, and the most that is told, px."""


def overlap(disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return by how much the nearest surface that leads to the same column of the right view is nearer than a pixel.

    Columns of the right view count as the same if they are at most half a pixel apart, once rounded.

    Args:
        disparity: (y, x) float32, px, whole rows of the left view; NaN: none.

    Returns:
        (y, x) float32 in [0, 100], px: 0 where nothing lies in front; 100 where the column lies outside the right view;
        NaN where there is no disparity.

    Raises:
        StageError: if the map has not two dimensions.

    >>> overlap(np.float32([[0, 0, 0, 2, 0]])).tolist()
    [[0.0, 2.0, 0.0, 0.0, 0.0]]
    """
    require_shape("disparity", disparity, 2)
    found = np.full(disparity.shape, np.nan, np.float32)
    for row, told in zip(np.ascontiguousarray(disparity), found, strict=True):
        _write_overlap(row, np.float32(LARGEST), told)
    return found


@kernel
def _write_overlap(disparity: NDArray[np.float32], largest: np.float32, told: NDArray[np.float32]) -> None:
    width = len(disparity)
    nearest = np.full(width, -np.inf, np.float32)
    for x in range(width):
        seen = _column(x, disparity[x])
        if 0 <= seen < width:
            nearest[seen] = max(nearest[seen], disparity[x])
    for x in range(width):
        if not np.isnan(disparity[x]):
            seen = _column(x, disparity[x])
            told[x] = min(nearest[seen] - disparity[x], largest) if 0 <= seen < width else largest


@kernel
def _column(x: int, disparity: np.float32) -> int:
    """Return the column of the right view that a pixel leads to; -1 for none."""
    return -1 if np.isnan(disparity) else int(np.floor(x - disparity + np.float32(0.5)))
