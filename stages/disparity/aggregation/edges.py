"""What a step of disparity costs between two pixels: less, the more their gray differs.

Surfaces end where the gray changes, mostly. So both penalties fall smoothly with the difference of gray: they are
halved where it is ``edge`` levels, and a ninth where it is four times as much. The view is smoothed first, so that its
noise makes no edges.

Paths along rows and columns hold surfaces flat: their ``P1`` is large. The other paths follow slanted surfaces: their
``P1`` is small.
"""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.disparity.aggregation.levels import SCALE
from semidense.stages.disparity.declaration import AggregatedParams

FALL = 1.5
"""The power of the difference with which the penalties fall."""


def smooth(gray: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return each pixel's mean with its eight neighbours, weighed 1, 2, 1 along rows and columns; a half rounds up.

    Args:
        gray: (y, x) uint8; beyond the border it is continued by its edge.
    """
    wide = np.pad(gray.astype(np.uint16), 1, mode="edge")
    down = wide[:-2] + 2 * wide[1:-1] + wide[2:]
    total = down[:, :-2] + 2 * down[:, 1:-1] + down[:, 2:]
    made: NDArray[np.uint8] = ((total + 8) >> 4).astype(np.uint8)
    return made


def penalties(params: AggregatedParams) -> NDArray[np.int16]:
    """Return both penalties in levels: (straight or oblique, difference of gray 0 to 255, P1 or P2) int16."""
    plain = np.array([[params.p1, params.p2], [params.p1 * params.oblique, params.p2]]) * SCALE
    share = 1 / (1 + (np.arange(256) / params.edge) ** FALL)
    return np.rint(plain[:, None] * share[:, None]).astype(np.int16)


@kernel
def is_oblique(dy: int, dx: int) -> int:
    """Return 1 if a step goes along neither a row nor a column, else 0."""
    return 1 if dy != 0 and dx != 0 else 0


@kernel
def difference(gray: NDArray[np.uint8], y: int, x: int, v: int, u: int) -> int:
    """Return by how much the gray of two pixels differs; 0 if (v, u) is outside the image."""
    if not (0 <= v < gray.shape[0] and 0 <= u < gray.shape[1]):
        return 0
    return int(abs(np.int64(gray[y, x]) - np.int64(gray[v, u])))
