"""The figures of KITTI's stereo benchmarks, as their development kits work them out.

Both fill a map before they judge it: a pixel without a disparity is judged by what `fill_background` puts there. The
figures of 2015 are shares of the pixels of all frames together; those of 2012 are means over the frames.

Source: ``evaluate_scene_flow.cpp`` and ``evaluate_stereo.cpp`` of the development kits of Menze & Geiger, CVPR 2015,
and Geiger, Lenz & Urtasun, CVPR 2012.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.disparity.filling import fill_rows
from semidense.stages.metrics.errors import percentage, require_equal

ABSOLUTE, RELATIVE = 3.0, 0.05
"""A pixel is wrong if its error is larger than 3 px and larger than 5 % of the truth."""
REGIONS = ("bg", "fg", "all")
"""Background, moving cars and both."""
THRESHOLDS_2012 = (1.0, 2.0, 3.0, 4.0, 5.0)
"""Errors above which a pixel is wrong in 2012, px; 3 is the default of its tables."""
_UNFILLED = np.float32(-1)
Counts = NDArray[np.int64]


def fill_background(disparity: NDArray[Any]) -> NDArray[np.float32]:
    """Fill a map as the kits do: a gap in a row gets the smaller of the disparities at its ends.

    A gap at the end of a row gets the one at its other end; rows without any, above the first that has some or below
    the last, get that row. A row without any between two others stays unfilled, with -1.

    >>> fill_background(np.array([[np.nan, 5, np.nan, 3, np.nan]], np.float32)).tolist()
    [[5.0, 5.0, 3.0, 3.0, 3.0]]
    """
    known = np.where(np.isfinite(disparity), disparity, np.nan).astype(np.float32)
    rows = fill_rows(known)
    some = np.flatnonzero(~np.isnan(rows).all(axis=1))
    if some.size:
        rows[: some[0]], rows[some[-1] + 1 :] = rows[some[0]], rows[some[-1]]
    return np.where(np.isnan(rows), _UNFILLED, rows)


def d1_counts(disparity: NDArray[Any], truth: NDArray[Any], objects: NDArray[Any] | None = None) -> Counts:
    """Count the outliers of a frame; the counts of several frames are added and given to `d1_figures`.

    Args:
        disparity: (y, x) float, px, NaN where nothing is reported.
        truth: (y, x) float, NaN where unknown: of all pixels, or of those that both views see.
        objects: (y, x) integers, 0 for background, above for a moving car; None takes all for background.

    Returns:
        (region, count) int64, `REGIONS` by wrong pixels and pixels, then the same of those that are reported.

    Raises:
        StageError: If the shapes differ.
    """
    require_equal("disparity", disparity, truth)
    foreground = np.zeros(truth.shape, bool) if objects is None else objects > 0
    require_equal("objects", foreground, truth)
    error = np.abs(truth.astype(np.float32) - fill_background(disparity))
    with np.errstate(divide="ignore", invalid="ignore"):
        wrong = (error > ABSOLUTE) & (error / np.abs(truth) > RELATIVE)
    known, reported = np.isfinite(truth), np.isfinite(disparity)
    regions = (known & ~foreground, known & foreground, known)
    return np.array([[_count(each & wrong), _count(each), *_both(each & reported, wrong)] for each in regions])


def d1_figures(counts: Counts) -> dict[str, float]:
    """Return ``D1-bg D1-fg D1-all``, percent of outliers, ``D1-est`` of the reported pixels alone, and ``density``.

    NaN where there is no pixel to speak of.
    """
    shares = {
        f"D1-{region}": _share(wrong, pixels) for region, (wrong, pixels, *_) in zip(REGIONS, counts, strict=True)
    }
    _, pixels, wrong, reported = counts[-1]
    return shares | {"D1-est": _share(wrong, reported), "density": _share(reported, pixels)}


def kitti2012_figures(disparity: NDArray[Any], truth: NDArray[Any]) -> dict[str, float]:
    """Return the figures of one frame; those of the benchmark are their means over the frames.

    Args:
        disparity: (y, x) float, px, NaN where nothing is reported.
        truth: (y, x) float, NaN where unknown.

    Returns:
        ``out1 out2 out3 out4 out5``, percent of the pixels of known truth that are off by more than so many px in the
        filled map; ``avg``, their mean error, px; ``density``, percent reported. NaN without a pixel of known truth.

    Raises:
        StageError: If the shapes differ.
    """
    require_equal("disparity", disparity, truth)
    known = np.isfinite(truth)
    error = np.abs(truth.astype(np.float32) - fill_background(disparity))[known]
    out = {f"out{threshold:.0f}": percentage(error > threshold) for threshold in THRESHOLDS_2012}
    mean = float(error.mean(dtype=np.float64)) if error.size else float("nan")
    return out | {"avg": mean, "density": percentage(np.isfinite(disparity)[known])}


def _count(chosen: NDArray[np.bool_]) -> int:
    return int(np.count_nonzero(chosen))


def _both(chosen: NDArray[np.bool_], wrong: NDArray[np.bool_]) -> tuple[int, int]:
    return _count(chosen & wrong), _count(chosen)


def _share(part: int, whole: int) -> float:
    return 100 * int(part) / int(whole) if whole else float("nan")
