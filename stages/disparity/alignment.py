"""By how much the right view's rows lie below those of the left one: what rectification left over.

Rectified pairs are often off by half a pixel, differently at each end of the image, and a network that compares rows
feels it. The matches of ``survey`` are made exact below a pixel, by gradients (Lucas & Kanade, "An iterative image
registration technique with an application to stereo vision", IJCAI 1981), and a plane is laid through their vertical
offsets. Three numbers of thousands of matches: a scene cannot bend it, and no ground truth is asked.
"""

from typing import TypedDict

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from semidense.stages.disparity.survey import ENOUGH, Surveyed, side_by_side
from semidense.stages.stage import Images, NoParams
from semidense.stages.transforms.declaration import LARGEST_OFFSET, Alignment
from semidense.stages.transforms.gray import gray_views

LEAST_OFFSET = 0.1
"""A plane that nowhere reaches this is none, px: what matches measure of an exact pair stays below it."""
MOST = 2000
"""Matches that are looked at, at most."""
UNEXPLAINED = 0.35
"""Median distance of the offsets from the plane, px, beyond which they follow none."""
UNCERTAIN = 0.125
"""Standard error of the plane in its least certain corner, px, beyond which the matches are too few or lie too close
together. It is 0.01 to 0.03 px in most of the training scenes, and never more than 0.12 px."""
_RADIUS = 5
"""Of the square patches that are compared, px."""
_BLUR = 1.0
_ROUNDS = 6
_SETTLED = 0.1
_FARTHEST = 3.0
"""A patch that wanders further from where it began has lost its match, px."""
_ALIKE = 0.9
"""Least correlation of a patch and its match."""
_CONTRAST = 1.0
"""Least mean square of a patch's slope in the direction where it is least, squared gray levels a pixel."""
_REWEIGHTED = 20
_CLOSE = 0.1
_OF_MEDIAN = 1.4826
"""Deviation of a normal distribution, in medians of its absolute values."""
_EXACT = 0.02
"""No offset is known better than this, px."""

_Floats = NDArray[np.float64]


class OfSurvey(TypedDict):
    """The views, and the look at them."""

    images: Images
    survey: Surveyed


def compute_alignment(_: NoParams, inputs: OfSurvey) -> Alignment:
    """Compute the product ``alignment``; see ``offsets`` and ``plane``."""
    left, right = gray_views(inputs["images"])
    found = offsets(left, right, inputs["survey"])
    height, width = left.shape
    level, across, down = plane(found, (height, width))
    columns = level + across * (np.arange(width) / width - 0.5)
    rows = down * (np.arange(height) / height - 0.5)
    return {
        "rows": rows.astype(np.float32),
        "columns": columns.astype(np.float32),
        "offsets": found.astype(np.float32),
    }


def offsets(left: NDArray[np.uint8], right: NDArray[np.uint8], survey: Surveyed) -> _Floats:
    """Return where matches lie in the right view and how far below their left pixels, to a fraction of a pixel.

    Args:
        left: (y, x) gray.
        right: the other view, of the same size.
        survey: the look at this pair.

    Returns:
        (match, 3): row and column in the right view, and the offset in px. Matches are left out whose patch has no
        clear place in the right view.
    """
    chosen = survey["matches"][:: max(1, -(-len(survey["matches"]) // MOST))].astype(np.float64)
    step = int(survey["step"][0])
    y, x, disparity, vertical = chosen.T
    places, moved = np.stack([y, x], axis=1), np.stack([vertical, -disparity], axis=1)
    if step > 1:  # first where the views are small, so that a patch cannot lose its match
        moved, good = _tracked(survey["left"], survey["right"], places / step, moved / step)
        places, moved = places[good] + (step - 1) / 2, moved[good] * step
    moved, good = _tracked(left, right, places, moved)
    return np.concatenate([np.rint(places) + moved, moved[:, :1]], axis=1)[good]


def plane(found: _Floats, size: tuple[int, int]) -> tuple[float, float, float]:
    """Lay a plane through the offsets, so that the sum of the distances is least.

    Args:
        found: (match, 3), from ``offsets``.
        size: rows and columns of the image.

    Returns:
        The offset in the middle of the image and its change from the left to the right border and from top to bottom,
        px. All 0 with fewer than ``ENOUGH`` matches, if these follow no plane or leave it open, or if the plane is
        nowhere ``LEAST_OFFSET`` or somewhere beyond ``LARGEST_OFFSET``.
    """
    none = 0.0, 0.0, 0.0
    if len(found) < ENOUGH:
        return none
    places = found[:, :2] / size - 0.5
    terms = np.stack([np.ones(len(found)), places[:, 1], places[:, 0]], axis=1)
    weights, distances = np.ones(len(found)), np.zeros(len(found))
    level, across, down = none
    for _ in range(_REWEIGHTED):
        scale = np.sqrt(weights)
        level, across, down = np.linalg.lstsq(terms * scale[:, None], found[:, 2] * scale, rcond=None)[0].tolist()
        distances = np.abs(terms @ (level, across, down) - found[:, 2])
        weights = 1 / np.maximum(distances, _CLOSE)
    largest = abs(level) + (abs(across) + abs(down)) / 2
    unexplained = float(np.median(distances))
    alike = len(found) / side_by_side(found[:, :2], 2 * _RADIUS + 1)
    if unexplained > UNEXPLAINED or _uncertain(terms, unexplained) * np.sqrt(alike) > UNCERTAIN:
        return none
    return (level, across, down) if LEAST_OFFSET <= largest <= LARGEST_OFFSET else none


def _uncertain(terms: _Floats, unexplained: float) -> float:
    """Return the standard error of a plane in its least certain corner, px.

    Args:
        terms: (match, 3), as ``plane`` has them: 1, the column and the row, each from -0.5 to 0.5.
        unexplained: median distance of the offsets from the plane, px.
    """
    corners = np.array([[1, across, down] for across in (-0.5, 0.5) for down in (-0.5, 0.5)])
    known = terms.T @ terms + 1e-9 * np.eye(3)  # matches on one line leave a corner open: it must not be singular
    spread = max(_OF_MEDIAN * unexplained, _EXACT)
    return spread * float(np.sqrt((corners @ np.linalg.inv(known) * corners).sum(axis=1).max()))


def _tracked(
    left: NDArray[np.uint8], right: NDArray[np.uint8], places: _Floats, moved: _Floats
) -> tuple[_Floats, NDArray[np.bool_]]:
    """Make moves exact: of the patches of the left view around some pixels into the right view.

    Args:
        left: (y, x) gray.
        right: the other view, of the same size.
        places: (match, 2) row and column of the patches' middles; they are rounded.
        moved: (match, 2) by how much they moved, to 2 px.

    Returns:
        (match, 2) the moves, and (match,) which of them can be believed: none in views with no room for a patch.
    """
    if min(left.shape) <= 2 * _RADIUS:
        return moved, np.zeros(len(moved), bool)
    views = [gaussian_filter(view.astype(np.float32), _BLUR, mode="nearest") for view in (left, right)]
    side = np.arange(-_RADIUS, _RADIUS + 1)
    around = np.stack(np.meshgrid(side, side, indexing="ij")).reshape(2, 1, -1)
    middle = np.rint(places).T[..., None]
    last = np.array(left.shape)[:, None, None] - 1
    inside = ((middle >= _RADIUS) & (middle <= last - _RADIUS)).all(axis=(0, 2))
    rows, columns = (middle + around).astype(np.intp).clip(0, last)
    patches, spread = _standard(views[0][rows, columns])
    slopes = np.stack([slope[rows, columns] for slope in np.gradient(views[0])]) / spread
    bends = np.einsum("amp,bmp->mab", slopes, slopes)
    least = np.linalg.eigvalsh(bends)[:, 0] * spread[:, 0] ** 2 / around.shape[2]
    good = inside & (least > _CONTRAST)
    bends[~good] = np.eye(2)
    now, change = moved.copy(), np.zeros_like(moved)
    seen = patches
    for _ in range(_ROUNDS):
        seen, _ = _standard(map_coordinates(views[1], middle + around + now.T[..., None], order=1, mode="nearest"))
        change = np.linalg.solve(bends, np.einsum("amp,mp->ma", slopes, patches - seen)[..., None])[..., 0]
        now += np.clip(change, -1, 1)
    alike = (patches * seen).mean(axis=1)
    wandered = np.abs(now - moved).max(axis=1)
    good &= (alike > _ALIKE) & (np.abs(change).max(axis=1) < _SETTLED) & (wandered < _FARTHEST)
    return now, good


def _standard(patches: NDArray[np.floating]) -> tuple[_Floats, _Floats]:
    """Return patches (match, pixel) with mean 0 and deviation 1, and their deviation (match, 1)."""
    centred = patches - patches.mean(axis=1, keepdims=True, dtype=np.float64)
    spread = np.maximum(centred.std(axis=1, keepdims=True), 1e-3)
    return centred / spread, spread
