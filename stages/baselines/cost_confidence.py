"""Confidence of the raw disparity, read off the cost volume: APKR, PKRN, left-right difference, the cost itself.

The measures want positive costs. The volume holds the log-odds z of a mismatch; here ``c = ln(1 + exp(z))`` is taken,
the negative logarithm of the probability of a match: positive, and rising with z, so the winner is the same.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.baselines.declaration import CostConfidenceParams, CostMeasures, require_odd
from semidense.stages.compute.kernel import kernel
from semidense.stages.stage import OfVolume, require_shape

EPSILON = np.float32(1e-3)
"""Added to what is divided: a cost of 0 would make every ratio infinite, however near the rival is."""


def cost_confidence(costs: NDArray[Any], d_min: int, window: int) -> CostMeasures:
    """Return four confidence measures of the disparity of least cost; higher is surer.

    With ``c1`` the least cost of a pixel, ``c2`` the second least, ``c2m`` the least of the other local minima (``c2``
    where there is none), and ``cR`` the volume as the right view sees it:

    - ``msm = -c1``;
    - ``pkrn = c2 / c1``;
    - ``apkr``: the mean over the window of ``c(q, d2m) / c(q, d1)`` at the two disparities of its *centre*;
    - ``lrd = (c2 - c1) / |c1 - min_d cR(x - d1, d)|``.

    Args:
        costs: (y, x, d) float16 or float32, log-odds of a mismatch; NaN invalid.
        d_min: the disparity of index 0, px.
        window: side of APKR's window, px, odd; it is cut at the image border.

    Returns:
        ``apkr``, ``pkrn``, ``lrd``, ``msm``: (y, x) float32; NaN where a pixel has no valid cost or, but for ``msm``,
        only one.

    Raises:
        StageError, ValueError: if the volume has not three dimensions or the window is even.

    Source: Hu & Mordohai, PAMI 2012; Kim et al., "Stereo confidence metrics using the costs of surrounding pixels",
    DSP 2014.
    """
    require_shape("the cost volume", costs, 3)
    with np.errstate(invalid="ignore"):  # NaN is an invalid cell, and stays NaN
        positive = np.logaddexp(np.float32(0), costs.astype(np.float32))
    pkrn, apkr, lrd, msm = (np.full(costs.shape[:2], np.nan, np.float32) for _ in range(4))
    best, rival = (np.full(costs.shape[:2], -1, np.int32) for _ in range(2))
    _rank(positive, d_min, best, rival, pkrn, lrd, msm)
    _average_ratio(positive, best, rival, require_odd(window) // 2, apkr)
    return {"apkr": apkr, "pkrn": pkrn, "lrd": lrd, "msm": msm}


@kernel
def _rank(
    costs: NDArray[np.float32],
    d_min: int,
    best: NDArray[np.int32],
    rival: NDArray[np.int32],
    pkrn: NDArray[np.float32],
    lrd: NDArray[np.float32],
    msm: NDArray[np.float32],
) -> None:
    """Write each pixel's winner, its rival, and the measures that need no neighbours."""
    height, width, _ = costs.shape
    right = np.empty(width, np.float32)
    for y in range(height):
        _right_minima(costs[y], d_min, right)
        for x in range(width):
            first, second, other = _three_least(costs[y, x])
            if first < 0:
                continue
            best[y, x], rival[y, x] = first, other
            least = costs[y, x, first]
            msm[y, x] = -least
            if second >= 0:
                next_least = costs[y, x, second]
                pkrn[y, x] = (next_least + EPSILON) / (least + EPSILON)
                lrd[y, x] = (next_least - least) / (abs(least - right[x - d_min - first]) + EPSILON)


@kernel
def _right_minima(costs: NDArray[np.float32], d_min: int, right: NDArray[np.float32]) -> None:
    """Write the least cost of each pixel of the right view's row, infinity where it has none."""
    width, depth = costs.shape
    right[:] = np.inf
    for x in range(width):
        for k in range(depth):
            seen = x - d_min - k
            if 0 <= seen < width and costs[x, k] < right[seen]:
                right[seen] = costs[x, k]


@kernel
def _three_least(costs: NDArray[np.float32]) -> tuple[int, int, int]:
    """Return the indices of the least cost, the second least and the least of the other local minima; -1 for none."""
    first, second, other = -1, -1, -1
    depth = costs.size
    for k in range(depth):
        if not np.isnan(costs[k]) and (first < 0 or costs[k] < costs[first]):
            first = k
    for k in range(depth):
        if k == first or np.isnan(costs[k]):
            continue
        if second < 0 or costs[k] < costs[second]:
            second = k
        # A comparison with NaN is false: beside an invalid cell stands no lower one.
        higher = (k > 0 and costs[k - 1] < costs[k]) or (k < depth - 1 and costs[k + 1] < costs[k])
        if not higher and (other < 0 or costs[k] < costs[other]):
            other = k
    return first, second, other if other >= 0 else second


@kernel
def _average_ratio(
    costs: NDArray[np.float32],
    best: NDArray[np.int32],
    rival: NDArray[np.int32],
    radius: int,
    apkr: NDArray[np.float32],
) -> None:
    """Write the mean over the window of the ratio of two costs, at the disparities of the window's centre."""
    height, width, _ = costs.shape
    for y in range(height):
        for x in range(width):
            first, other = best[y, x], rival[y, x]
            if other < 0:
                continue
            total, count = 0.0, 0
            for v in range(max(0, y - radius), min(height, y + radius + 1)):
                for u in range(max(0, x - radius), min(width, x + radius + 1)):
                    ratio = (costs[v, u, other] + EPSILON) / (costs[v, u, first] + EPSILON)
                    if not np.isnan(ratio):
                        total += ratio
                        count += 1
            apkr[y, x] = total / count


def compute_cost_confidence(params: CostConfidenceParams, inputs: OfVolume) -> CostMeasures:
    """Compute the product ``cost_confidence``; see ``cost_confidence``."""
    volume = inputs["costvolume"]
    return cost_confidence(volume["cost"], int(volume["d"][0]), params.window)
