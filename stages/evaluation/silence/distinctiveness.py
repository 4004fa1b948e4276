"""Distinctiveness: whether a patch of a view differs from the patches beside it along its rows.

A patch that repeats itself along the rows fits several places of the other view equally well, whatever the two views
show: in a blank region, in stripes along the rows, in a vertical gradient, in a pattern with a period.
"""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.evaluation.silence.declaration import (
    MOST_DISTINCT,
    NEAREST_REPETITION,
    Distinctiveness,
    DistinctivenessParams,
)
from semidense.stages.stage import OfImages
from semidense.stages.transforms.gray import require_gray, to_gray


def distinctiveness(gray: NDArray[np.uint8], params: DistinctivenessParams) -> NDArray[np.float32]:
    """Return how much the image around each pixel differs from itself a few pixels to the side.

    For a window ``W`` of the image and all shifts ``s`` from 4 px to ``params.reach``, either way along the rows::

        t(W) = min_s mean_W |I(x) - I(x + s)| / (noise + share * std_W)

    where ``std_W`` is the standard deviation of the window's pixels from their row's mean. A pixel has the least ``t``
    of all windows that hold it or come within ``params.margin`` px of it: a region that repeats itself is told up to
    its border, where a JPEG file adds waves of its own.

    Args:
        gray: (y, x) uint8.
        params: the window, the noise and the shifts.

    Returns:
        (y, x) float32 in [0, 100]. Below 1 the pixel has no texture by which its disparity could be found. 100 where
        no window with a shifted one fits into the image.

    Raises:
        StageError: if ``gray`` is no 8-bit gray image, or the range of disparities is open.

    Source: Manduchi & Tomasi, "Distinctiveness maps for image matching", ICIAP 1999; the scale by noise and contrast
    and the least of all windows are added.

    >>> blank = np.full((9, 40), 7, np.uint8)
    >>> float(distinctiveness(blank, DistinctivenessParams(d_min=0, d_max=8)).max())
    0.0
    """
    require_gray(gray)
    window, reach = params.window, params.reach
    if min(gray.shape) < window:
        return np.full(gray.shape, MOST_DISTINCT, np.float32)
    values = np.ascontiguousarray(gray).astype(np.int32)
    least = np.full([length - window + 1 for length in gray.shape], np.iinfo(np.int32).max, np.int32)
    _least_difference(values, window, reach, least)
    allowed = window**2 * (params.noise + params.share * _deviation(values, window))
    told = np.minimum(least / allowed, MOST_DISTINCT).astype(np.float32)
    return _least_of_windows(told, window, params.margin)


def _deviation(values: NDArray[np.int32], window: int) -> NDArray[np.float64]:
    """Return the standard deviation of each window's pixels from the mean of their row, by exact sums."""
    sums, squares = (_row_sums(power, window) for power in (values.astype(np.int64), values.astype(np.int64) ** 2))
    spread = _row_sums((window * squares - sums**2).T, window).T
    deviation: NDArray[np.float64] = np.sqrt(spread / np.float64(window**3))
    return deviation


def _row_sums(values: NDArray[np.int64], window: int) -> NDArray[np.int64]:
    """Return the sums of ``window`` neighbours along the last axis, which is shorter by ``window - 1``."""
    total = np.cumsum(np.pad(values, ((0, 0), (1, 0))), axis=1)
    sums: NDArray[np.int64] = total[:, window:] - total[:, :-window]
    return sums


def _least_of_windows(told: NDArray[np.float32], window: int, margin: int) -> NDArray[np.float32]:
    """Return for each pixel the least value of the windows near it; ``told`` goes by their first pixels."""
    reach = window - 1 + margin
    for _ in range(2):
        padded = np.pad(told, ((reach, reach), (0, 0)), constant_values=MOST_DISTINCT)
        last = len(padded) - reach - margin
        told = np.min([padded[first : last + first] for first in range(reach + margin + 1)], axis=0).T
    return told


@kernel
def _least_difference(values: NDArray[np.int32], window: int, reach: int, least: NDArray[np.int32]) -> None:
    """Write each window's least sum of absolute differences to the windows beside it, by their first pixels."""
    height, width = values.shape
    for shift in range(NEAREST_REPETITION, min(reach, width - window) + 1):
        columns = np.zeros(width - shift, np.int32)
        for y in range(height):
            row, beside = values[y], values[y, shift:]  # an index that is known to be in the array takes vectors
            for x in range(len(columns)):
                columns[x] += abs(row[x] - beside[x])
            if y >= window:
                row, beside = values[y - window], values[y - window, shift:]
                for x in range(len(columns)):
                    columns[x] -= abs(row[x] - beside[x])
            if y >= window - 1:
                _write_least(columns, window, shift, least[y - window + 1])


@kernel
def _write_least(columns: NDArray[np.int32], window: int, shift: int, least: NDArray[np.int32]) -> None:
    """Sum columns to windows; each sum is that of two windows, ``shift`` apart."""
    sums = np.empty(len(columns) - window + 1, np.int32)
    total = columns[: window - 1].sum()
    for x in range(len(sums)):
        total += columns[x + window - 1]
        sums[x] = total
        total -= columns[x]
    for at in (least, least[shift:]):
        for x in range(len(sums)):
            at[x] = min(at[x], sums[x])


def compute_distinctiveness(params: DistinctivenessParams, inputs: OfImages) -> Distinctiveness:
    """Compute the product ``distinctiveness`` of both views; see ``distinctiveness``."""
    images = inputs["images"]
    left, right = (distinctiveness(to_gray(view), params) for view in (images["left"], images["right"]))
    return {"left": left, "right": right}
