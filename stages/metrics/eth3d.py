"""The figures of ETH3D's two-view benchmark, as its evaluation program works them out.

Shares of bad pixels are of the reported ones; the coverage says how many those are. A disparity farther from 0 than the
image is wide counts as not reported.

Source: https://github.com/ETH3D/two-view-evaluation
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.metrics.errors import QUANTILES, THRESHOLDS, counted, percentage, require_equal


def eth3d_figures(disparity: NDArray[Any], truth: NDArray[Any], mask: NDArray[np.bool_]) -> dict[str, float]:
    """Return the figures of a map, in the columns of the published tables.

    Args:
        disparity: (y, x) float, px, NaN or infinity where nothing is reported.
        truth: (y, x) float, NaN where unknown.
        mask: (y, x) bool: visible in both views, or everywhere.

    Returns:
        ``bad0.5 bad1.0 bad2.0 bad4.0``, percent of the reported pixels whose error is larger; ``avgerr rms A50 A90 A95
        A99`` of them, px; ``coverage``, percent of the pixels that count. Without a reported pixel, the worst
        there is: 100 % bad, infinite errors. The quantile A90 is the error number ``floor(0.9 n)`` of n in rising
        order, from 0.

    Raises:
        StageError: If the shapes differ, or the mask is not bool.
    """
    require_equal("disparity", disparity, truth)
    counts = counted(truth, mask)
    found = disparity[counts].astype(np.float32)
    reported = np.abs(found) <= disparity.shape[1]
    errors = np.sort(np.abs(found[reported] - truth[counts][reported].astype(np.float32)))
    coverage = {"coverage": percentage(reported)}
    bad = {f"bad{threshold:.1f}": percentage(errors > threshold) for threshold in THRESHOLDS}
    if not errors.size:
        return dict.fromkeys(bad, 100.0) | dict.fromkeys(("avgerr", "rms", *QUANTILES), float("inf")) | coverage
    exact = errors.astype(np.float64)
    sizes = {"avgerr": float(exact.mean()), "rms": float(np.sqrt(np.mean(exact**2)))}
    return bad | sizes | {name: _at(errors, share) for name, share in QUANTILES.items()} | coverage


def _at(errors: NDArray[np.float32], share: float) -> float:
    # The program multiplies in single precision.
    return float(errors[int(np.floor(np.float32(errors.size) * np.float32(share)))])
