"""Seek square patches of a row of one view in several rows of the other, by normalised cross-correlation.

All sums are of whole numbers below 2 ** 53, so that they are exact in float64, in whatever order they are taken.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.disparity.survey import PATCH

SIDE = PATCH
RADIUS = SIDE // 2
AREA = SIDE**2
BESIDE = 2
"""A place of the row so near to the best one is no rival, px."""

_Floats = NDArray[np.float64]
_Places = NDArray[np.int64]


class Patches(NamedTuple):
    """A view and all patches of it, by their first pixel.

    Attributes:
        values: (y, x) whole numbers below 2 ** 18.
        sums: (y, x) sum of each patch.
        lengths: (y, x) length of each patch without its mean, times ``SIDE``.
    """

    values: _Floats
    sums: _Floats
    lengths: _Floats


class Found(NamedTuple):
    """For each patch of the row, by x: where its best place is, and how far that can be trusted.

    Attributes:
        score: correlation at the best place.
        row: its first row.
        column: its column.
        back: x of the patch of the row that the best place has as its own best.
        rival: largest correlation of any row in columns further than ``BESIDE`` from the best; at least -1.
    """

    score: _Floats
    row: _Places
    column: _Places
    back: _Places
    rival: _Floats


def patches_of(values: _Floats) -> Patches:
    """Return the patches of a view, (y, x), which is no smaller than one."""
    sums, squares = _window_sums(values), _window_sums(values**2)
    return Patches(values, sums, np.sqrt(AREA * squares - sums**2))


def _window_sums(values: _Floats) -> _Floats:
    for _ in range(2):
        total = np.cumsum(np.pad(values, ((1, 0), (0, 0))), axis=0)
        values = (total[SIDE:] - total[:-SIDE]).T
    return values


def search(left: Patches, right: Patches, y: int, reach: int) -> Found:
    """Seek the left view's patches whose first row is ``y`` in the rows of the right view up to ``reach`` away."""
    top, end = max(0, y - reach), min(len(right.sums), y + reach + 1)
    count = left.sums.shape[1]
    found = Found(
        np.full(count, -np.inf), np.zeros(count, int), np.zeros(count, int), np.zeros(count, int), np.full(count, -1.0)
    )
    own, others = (_inverse(lengths) for lengths in (left.lengths[y], right.lengths[top:end]))
    _search(
        left.values[y : y + SIDE],
        right.values[top : end + SIDE - 1],
        left.sums[y],
        right.sums[top:end],
        own,
        others,
        found.score,
        found.row,
        found.column,
        found.back,
        found.rival,
    )
    return found._replace(row=found.row + top)


def _inverse(lengths: _Floats) -> _Floats:
    """Return 1 / length; 0 for patches of one value, which correlate with nothing."""
    return np.divide(1, lengths, out=np.zeros_like(lengths), where=lengths > 0)


@kernel
def _search(
    own: _Floats,
    others: _Floats,
    own_sums: _Floats,
    other_sums: _Floats,
    own_inverse: _Floats,
    other_inverse: _Floats,
    best: _Floats,
    best_row: _Places,
    best_column: _Places,
    back: _Places,
    rival: _Floats,
) -> None:
    """Write what ``Found`` tells. Of equal correlations the one in the first row counts, there the first column."""
    rows, count = other_sums.shape
    columns, twos, fours = np.empty(count + SIDE - 1), np.empty(count + SIDE), np.empty(count + SIDE)
    scores = np.empty(count)
    along = np.full((2 * count - 1, count), -1.0)  # shift, x: the largest of all rows
    back_score, back_x = np.full((rows, count), -np.inf), np.zeros((rows, count), np.int64)
    for row in range(rows):
        for shift in range(count - 1, -count, -1):
            first, width = max(0, shift), count - abs(shift)
            at = slice(first, first + width)
            there = slice(first - shift, first - shift + width)
            _multiply(own, others, row, first, first - shift, columns[: width + SIDE - 1])
            _sum_beside(columns[: width + SIDE - 1], twos, fours, scores)
            _normalise(scores, own_sums[at], other_sums[row, there], own_inverse[at], other_inverse[row, there])
            _keep_best(scores, row, first, shift, best[at], best_row[at], best_column[at])
            _keep_back(scores, first, back_score[row, there], back_x[row, there])
            highest = along[shift + count - 1, at]
            for x in range(width):
                highest[x] = max(highest[x], scores[x])
    for x in range(count):
        back[x] = back_x[best_row[x], best_column[x]]
    for shift in range(1 - count, count):
        for x in range(count):
            if abs(shift - (x - best_column[x])) > BESIDE:
                rival[x] = max(rival[x], along[shift + count - 1, x])


@kernel
def _multiply(own: _Floats, others: _Floats, row: int, x: int, column: int, columns: _Floats) -> None:
    """Write the sum of products of each column of two strips, from ``x`` and ``column`` on."""
    one, other = own[0, x:], others[row, column:]
    for i in range(len(columns)):
        columns[i] = one[i] * other[i]
    for k in range(1, SIDE, 2):  # two rows at a time take fewer stores
        one, other = own[k, x:], others[row + k, column:]
        two, another = own[k + 1, x:], others[row + k + 1, column:]
        for i in range(len(columns)):
            columns[i] += one[i] * other[i] + two[i] * another[i]


@kernel
def _sum_beside(columns: _Floats, twos: _Floats, fours: _Floats, sums: _Floats) -> None:
    """Write the sums of thirteen columns side by side, by those of two and of four: a running sum takes no vectors."""
    for x in range(len(columns) - 1):
        twos[x] = columns[x] + columns[x + 1]
    for x in range(len(columns) - 3):
        fours[x] = twos[x] + twos[x + 2]
    for x in range(len(columns) - 12):
        sums[x] = fours[x] + fours[x + 4] + fours[x + 8] + columns[x + 12]


@kernel
def _normalise(scores: _Floats, sums: _Floats, other_sums: _Floats, inverse: _Floats, other_inverse: _Floats) -> None:
    """Make correlations of sums of products."""
    for x in range(len(sums)):
        scores[x] = (AREA * scores[x] - sums[x] * other_sums[x]) * inverse[x] * other_inverse[x]


@kernel
def _keep_best(
    scores: _Floats, row: int, first: int, shift: int, best: _Floats, best_row: _Places, best_column: _Places
) -> None:
    for x in range(len(best)):
        if scores[x] > best[x]:
            best[x], best_row[x], best_column[x] = scores[x], row, first + x - shift


@kernel
def _keep_back(scores: _Floats, first: int, back_score: _Floats, back_x: _Places) -> None:
    for x in range(len(back_score)):
        if scores[x] >= back_score[x]:  # shifts fall: the last of equal ones has the first x
            back_score[x], back_x[x] = scores[x], first + x
