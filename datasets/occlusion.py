"""Tell which pixels of the left view are visible in the right view, from the ground truth alone.

``stages/disparity/right_view.py`` checks computed maps in the same way: neither package may import the other, and one
table of tests holds both.
"""

import numpy as np
import numpy.typing as npt

from semidense.datasets.arrays import DisparityMap, Mask


def left_right_check(left_truth: DisparityMap, right_truth: DisparityMap, tolerance: float = 1.0) -> Mask:
    """Mark the left pixels whose match in the right view says the same disparity: ``|d_R(x - d_L(x)) - d_L(x)| <= t``.

    Args:
        left_truth: (y, x) float, pixels, NaN where unknown.
        right_truth: (y, x) float, pixels, of the right view, NaN where unknown; read at the nearest column.
        tolerance: Largest difference, pixels.

    Returns:
        (y, x) bool; false where the truth is unknown in either view or the match is outside the right view.

    >>> left = np.array([[np.nan, 1, 1, 2]], np.float32)
    >>> right = np.array([[1, 1, 9, 9]], np.float32)
    >>> left_right_check(left, right).tolist()
    [[False, True, True, True]]
    """
    rows, landing, inside = _landing(left_truth)
    column = np.where(inside, np.rint(landing), 0).astype(np.intp)
    with np.errstate(invalid="ignore"):
        agrees: Mask = np.abs(right_truth[rows, column] - left_truth) <= tolerance
    return inside & agrees


def warped_truth_mask(left_truth: DisparityMap, tolerance: float = 1.0) -> Mask:
    """Mark the left pixels that no nearer pixel covers in the right view, where only the left truth is known.

    Each pixel lands in the right view at ``x - d``, on the two columns around that; a column keeps the largest
    disparity that lands on it. A pixel is visible where it lands inside the image and its nearest column keeps no
    disparity more than ``tolerance`` above its own. Pixels of unknown truth cover nothing, so what they hide is
    reported as visible.

    Args:
        left_truth: (y, x) float, pixels, NaN where unknown.
        tolerance: How much nearer a pixel must be to cover another, pixels: neighbours on one slanted surface land
            on the same column and must not cover each other.

    Returns:
        (y, x) bool; false where the truth is unknown.

    >>> warped_truth_mask(np.array([[0, 0, 0, 2, 2, 0]], np.float32)).tolist()
    [[True, False, False, True, True, True]]
    """
    rows, landing, inside = _landing(left_truth)
    nearest = np.full(left_truth.shape, -np.inf, np.float32)
    for column in (np.floor(landing), np.ceil(landing)):
        chosen = column[inside].astype(np.intp)
        np.maximum.at(nearest, (rows[inside], chosen), left_truth[inside])
    column = np.where(inside, np.rint(landing), 0).astype(np.intp)
    with np.errstate(invalid="ignore"):
        uncovered: Mask = nearest[rows, column] - left_truth <= tolerance
    return inside & uncovered


def _landing(left_truth: DisparityMap) -> tuple[npt.NDArray[np.intp], DisparityMap, Mask]:
    """Give each pixel's row, its column in the right view, and whether that is inside the image."""
    grid: npt.NDArray[np.intp] = np.indices(left_truth.shape)
    rows, columns = grid[0], grid[1]
    landing: DisparityMap = (columns - left_truth).astype(np.float32)
    with np.errstate(invalid="ignore"):
        inside: Mask = (landing >= 0) & (landing <= left_truth.shape[1] - 1)
    return rows, landing, inside
