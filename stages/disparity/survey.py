"""A quick look at a pair before any network runs: what disparities it has, and whether it is a rectified pair at all.

On 24 rows of the views, shrunk to at most 480 px, square patches of the left view are sought in the right one, along
the row and up to 8 rows above and below it, by normalised cross-correlation. A match counts when it is good, each patch
is the other's best, no other place along the row is nearly as good, and its neighbours agree with it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from semidense.stages.stage import Array, NoParams, OfImages, Output, Stage
from semidense.stages.transforms.gray import to_gray

LONGEST = 480
"""Longest side of the views that are compared, px."""
PATCH = 13
"""Side of a patch, px of the shrunken views."""
REACH = 8
"""Rows above and below that are searched, px of the shrunken views."""
ENOUGH = 100
"""Matches below which nothing is said of the pair."""
_ROWS = 24
_GOOD = 0.8
_UNIQUE = 0.05
_CONTRAST = 2.0
_NEIGHBOURS = (-4, -3, -2, -1, 1, 2, 3, 4)
_AGREEING = 3
_SUPPORT = 0.005
_MARGIN = 0.2
_APART = 0.1
_SHARE = 0.05

_Floats = NDArray[np.float32]
FIELDS = ("y", "x", "disparity", "vertical")
"""What is told of a match, px of the image at hand: the left pixel, ``x_left - x_right`` and ``y_right - y_left``."""


@dataclass(frozen=True)
class Survey:
    """What was found.

    Attributes:
        matches: (match, field) float32, see ``FIELDS``.
        range: (2,) float32, px: an estimate of the smallest and largest disparity; NaN with too few matches.
        step: px of the image at hand to one of the shrunken views: how finely matches are placed.
    """

    matches: _Floats
    range: _Floats
    step: int


def survey(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> Survey:
    """Look at a pair.

    Args:
        left: (y, x) uint8 gray.
        right: the other view, of the same size.

    Returns:
        The matches and the range. Views smaller than a patch, or without texture, have no matches.
    """
    step = max(1, -(-max(left.shape) // LONGEST))
    rows = _matches(_square_sums(left, step), _square_sums(right, step), _CONTRAST * step**2)
    matches = np.concatenate([np.empty((0, len(FIELDS)), np.float32), *rows]) * np.float32(step)
    return Survey(matches.astype(np.float32), estimate_range(matches, step, left.shape[1]), step)


def side_by_side(places: Array, side: float) -> int:
    """Return how many squares of a side places lie in: patches that overlap tell the same.

    Args:
        places: (place, axis) px.
        side: px.
    """
    return len(np.unique(places // side, axis=0))


def shrink(view: NDArray[np.uint8], step: int) -> _Floats:
    """Return the means of squares of ``step`` x ``step`` px; what is left over at the right and below is cut off."""
    return (_square_sums(view, step) / step**2).astype(np.float32)


def _square_sums(view: NDArray[np.uint8], step: int) -> NDArray[np.float64]:
    height, width = (length // step for length in view.shape)
    squares = view[: height * step, : width * step].reshape(height, step, width, step)
    sums: NDArray[np.float64] = squares.sum(axis=(1, 3), dtype=np.float64)
    return sums


def estimate_range(matches: Array, step: int, width: int) -> _Floats:
    """Return the disparities to search, from those of the matches.

    Lonely disparities do not count: within two steps of one there must be half a percent of the matches, on three rows;
    and a group of disparities that lies apart, by a tenth of the width, must hold 5 %. What is left is widened by two
    steps, and by a fifth of its span on the side of near things, which may have no texture. On the far side it goes to
    0 if that at most triples it, since what is far often has none.

    Args:
        matches: (match, field), see ``FIELDS``.
        step: px between the places that a match can have.
        width: columns of the image, px.

    Returns:
        (2,) float32, whole px; NaN with fewer than ``ENOUGH`` matches.
    """
    values = _supported(matches[:, 2], matches[:, 0], step, width) if len(matches) >= ENOUGH else np.empty(0)
    if not values.size:
        return np.full(2, np.nan, np.float32)
    low, high = float(values.min()), float(values.max())
    first, last = _widened(low, high, step) if high > 0 else [-end for end in _widened(-high, -low, step)][::-1]
    return np.array([np.floor(first), np.ceil(last)], np.float32)


def _widened(low: float, high: float, step: int) -> tuple[float, float]:
    far = 0.0 if 0 <= 3 * low <= 2 * high else low - _MARGIN * (high - low) * (low > 0) - 2 * step
    return max(far, 0.0) if low >= 0 else far, high + _MARGIN * (high - low) + 2 * step


def _supported(disparity: Array, row: Array, step: int, width: int) -> Array:
    """Return those disparities, in order and each once, that enough matches share."""
    values = np.array([value for value in np.unique(disparity) if _is_common(disparity, row, value, step)])
    groups = np.split(values, np.nonzero(np.diff(values) > _APART * width)[0] + 1)
    large = [group for group in groups if np.isin(disparity, group).sum() >= _SHARE * disparity.size]
    return np.concatenate([np.empty(0), *large])


def _is_common(disparity: Array, row: Array, value: float, step: int) -> bool:
    near = np.abs(disparity - value) <= 2 * step
    return bool(near.sum() >= max(8, _SUPPORT * disparity.size) and np.unique(row[near]).size >= 3)


def _matches(left: NDArray[np.float64], right: NDArray[np.float64], contrast: float) -> Iterator[_Floats]:
    """Yield the matches of each row of patches that is looked at, (match, field), px of the shrunken views.

    Args:
        left: (y, x) whole numbers.
        right: of the same size.
        contrast: least standard deviation of a patch.
    """
    from semidense.stages.disparity import patch_search  # with Numba, which a plan does without

    if min(left.shape) < patch_search.SIDE:
        return
    views = patch_search.patches_of(left), patch_search.patches_of(right)
    height, width = views[0].sums.shape
    x = np.arange(width)
    for y in dict.fromkeys(np.linspace(0, height - 1, min(_ROWS, height)).astype(int).tolist()):
        found = patch_search.search(*views, y, REACH)
        clear = (found.score > _GOOD) & (np.abs(found.back - x) <= 1) & (found.rival < found.score - _UNIQUE)
        good = clear & (views[0].lengths[y] > contrast * patch_search.AREA)
        moved = x - found.column
        chosen = np.nonzero(good & _agreed(good, moved, found.row))[0]
        middle = np.stack([np.full(chosen.size, y), chosen]) + patch_search.RADIUS
        yield np.stack([*middle, moved[chosen], found.row[chosen] - y], axis=1).astype(np.float32)


def _agreed(good: NDArray[np.bool_], disparity: NDArray[np.intp], row: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return whether at least three of the eight nearest patches of the row moved alike."""
    support = np.zeros(good.size, int)
    for offset in _NEIGHBOURS:
        alike = np.abs(np.roll(disparity, offset) - disparity) <= 1
        near = np.abs(np.roll(row, offset) - row) <= 1
        support += np.roll(good, offset) & alike & near & _has_neighbour(good.size, offset)
    return support >= _AGREEING


def _has_neighbour(count: int, offset: int) -> NDArray[np.bool_]:
    """Return for each patch whether there is one so many places before it: the row does not go round."""
    place = np.arange(count) - offset
    return (place >= 0) & (place < count)


class Surveyed(TypedDict):
    """The product ``survey``: see ``Survey``, and the shrunken views (y, x)."""

    matches: NDArray[np.float32]
    range: NDArray[np.float32]
    equal: NDArray[np.float32]
    step: NDArray[np.int32]
    left: NDArray[np.uint8]
    right: NDArray[np.uint8]


def compute_survey(_: NoParams, inputs: OfImages) -> Surveyed:
    """Compute the product ``survey``; see ``survey``."""
    images = inputs["images"]
    left, right = to_gray(images["left"]), to_gray(images["right"])
    found = survey(left, right)
    return {
        "matches": found.matches,
        "range": found.range,
        "equal": np.array([np.mean(left == right)], np.float32),
        "step": np.array([found.step], np.int32),
        "left": np.rint(shrink(left, found.step)).astype(np.uint8),
        "right": np.rint(shrink(right, found.step)).astype(np.uint8),
    }


SURVEY = Stage(
    product="survey",
    inputs=("images",),
    outputs=(
        Output("matches", ("match", "field"), "float32", "px", "sparse matches: " + ", ".join(FIELDS)),
        Output("range", ("bound",), "float32", "px", "estimate of the smallest and largest disparity; NaN: none"),
        Output("equal", ("all",), "float32", "1", "share of pixels that are equal in both views"),
        Output("step", ("all",), "int32", "px", "side of the squares that the views were shrunk by"),
        Output("left", ("row", "column"), "uint8", "1", "left view, gray, shrunk"),
        Output("right", ("row", "column"), "uint8", "1", "right view, gray, shrunk"),
    ),
    compute="semidense.stages.disparity.survey:compute_survey",
)
"""A look at the pair. Not tiled: the views are shrunk first."""
