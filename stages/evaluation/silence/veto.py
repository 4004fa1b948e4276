"""The veto: no evidence, no confidence, whatever the map looks like."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.silence.declaration import Vetoing
from semidense.stages.stage import Array

TIED = 0.1
"""Margin below which a rival is as good as the winner, log-odds: what rounding of the costs makes of equal ones."""
UNDECIDED = 0.5
"""Mean margin of the pixels around below which they only seem to have a winner, log-odds: random costs have some."""
WINDOW = 9
"""Side of the window of that mean, px."""


def vetoed(inputs: Vetoing) -> NDArray[np.bool_]:
    """Return where the views or the costs tell no disparity, (y, x), of a block with 50 px of context all round.

    Args:
        inputs: the products ``distinctiveness``, ``disparity`` and ``cost_margin``.
    """
    views = inputs["distinctiveness"]
    silent = repetitive(views["left"], views["right"], inputs["disparity"]["disparity"])
    return silent | undecided(inputs["cost_margin"]["margin"])


def undecided(margin: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return where costs do not decide: a rival is as good as the winner, or nearly so in the whole neighbourhood.

    Args:
        margin: float32 (y + 100, x + 100), from ``cost_margin``, with 50 px of context all round; NaN counts as 0.

    Returns:
        (y, x) bool.
    """
    known = np.nan_to_num(margin)
    total = np.zeros([length - 2 * RADIUS for length in margin.shape], np.float64)
    _sum_windows(known, total)
    result: NDArray[np.bool_] = (_middle(known) < TIED) | (total < UNDECIDED * WINDOW**2)
    return result


def repetitive(
    left: NDArray[np.float32], right: NDArray[np.float32], disparity: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """Return where a view is not distinctive: the left one at a pixel, or the right one at the pixel it was matched to.

    Args:
        left: distinctiveness of the left view, float32 (y + 100, x + 100), with 50 px of context all round.
        right: that of the right view.
        disparity: px, NaN for none; of the same type and shape.

    Returns:
        (y, x) bool.
    """
    middle = _middle(disparity)
    rows, columns = np.indices(middle.shape)
    matched = columns + RADIUS - np.rint(np.nan_to_num(middle)).astype(np.intp)
    there = right[rows + RADIUS, np.clip(matched, 0, right.shape[1] - 1)]
    result: NDArray[np.bool_] = (_middle(left) < 1) | (there < 1)
    return result


def _middle(block: Array) -> Array:
    return block[RADIUS : block.shape[0] - RADIUS, RADIUS : block.shape[1] - RADIUS]


@kernel
def _sum_windows(values: NDArray[np.float32], total: NDArray[np.float64]) -> None:
    """Sum each window in one order, so that the sum does not depend on where a tile begins."""
    first = RADIUS - WINDOW // 2
    for y in range(total.shape[0]):
        for x in range(total.shape[1]):
            for row in range(y + first, y + first + WINDOW):
                for column in range(x + first, x + first + WINDOW):
                    total[y, x] += values[row, column]
