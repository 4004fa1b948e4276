"""Summed normalised cross-correlation: correlation over 3 x 3, averaged over a larger window."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.baselines.declaration import NCC_WINDOW, Matched, WindowParams
from semidense.stages.baselines.window import box_mean, match_windows
from semidense.stages.stage import OfImages
from semidense.stages.transforms.gray import gray_views

_RADIUS = NCC_WINDOW // 2
_FLAT = np.float32(1e-3)
"""Product of two variances below which a window is flat: nine whole gray values that differ at all vary by 8/81."""


def correlation(left: NDArray[np.float32], right: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the normalised cross-correlation of two arrays of gray values over 3 x 3 windows.

    ``(mean(l r) - mean(l) mean(r)) / (std(l) std(r))``; windows are cut at the border.

    Returns:
        float32 of the same shape, in [-1, 1]; 0 where a window of either is flat.
    """
    product = box_mean(left * right, _RADIUS) - box_mean(left, _RADIUS) * box_mean(right, _RADIUS)
    spread = _variance(left) * _variance(right)
    result = np.zeros_like(product)
    np.divide(product, np.sqrt(spread), out=result, where=spread > _FLAT)
    return np.clip(result, -1, 1)


def _variance(values: NDArray[np.float32]) -> NDArray[np.float32]:
    mean = box_mean(values, _RADIUS)
    return np.maximum(box_mean(values * values, _RADIUS) - mean * mean, np.float32(0))


def compute_sncc(params: WindowParams, inputs: OfImages) -> Matched:
    """Compute the product ``sncc``; see ``match_windows`` and ``correlation``.

    Source: Einecke & Eggert, "A two-stage correlation method for stereoscopic depth estimation", DICTA 2010.
    """
    # Around 0, the float32 sums of products lose less.
    left, right = (view.astype(np.float32) - 128 for view in gray_views(inputs["images"]))

    def costs(_: int, columns: slice, seen: slice) -> NDArray[np.float32]:
        return -correlation(left[:, columns], right[:, seen])

    return match_windows(costs, left.shape, params.disparities, params.window, params.tolerance)
