"""The figures of the Middlebury evaluation, version 3, as its development kit works them out.

Unlike `semidense.stages.metrics.errors`: the percentage of bad pixels is of all pixels that count, disparities are cut
to the range searched first, and thresholds and errors are in pixels of the full size.

Source: ``evaldisp`` of MiddEvalSDK 1.6, and the tables at https://vision.middlebury.edu/stereo/eval3/. The kit has no
quantiles: A50 to A99 are the smallest errors that occur and that at least that share of the errors do not exceed.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.metrics.errors import QUANTILES, THRESHOLDS, counted, percentage, require_equal
from semidense.stages.stage import StageError

FULL_SIZE = {"F": 1.0, "H": 2.0, "Q": 4.0}
"""Pixels of the full size to one of each published size."""
_HARD = ("PianoL", "Playroom", "Playtable", "Shelves", "Vintage")
WEIGHTS = {
    **dict.fromkeys(("Adirondack", "ArtL", "Jadeplant", "Motorcycle", "MotorcycleE", "Piano", "Pipes"), 8.0),
    **dict.fromkeys(("PlaytableP", "Recycle", "Teddy"), 8.0),
    **dict.fromkeys(_HARD, 4.0),
}
"""Percent that each training pair has of the mean over all 15: half as much for those that are hard."""


def middlebury_figures(
    disparity: NDArray[Any], truth: NDArray[Any], mask: NDArray[np.bool_], largest: float, unit: float = 1.0
) -> dict[str, float]:
    """Return the figures of a map, in the columns of the published tables.

    Args:
        disparity: (y, x) float, px of its own size, NaN or infinity where nothing is reported.
        truth: (y, x) float, exactly 1, 2 or 4 times as large as the map, which is then enlarged; NaN where unknown.
        mask: (y, x) bool, of the truth's shape: visible in both views for ``nonocc``, everywhere for ``all``.
        largest: the largest disparity searched, px of the map; reported ones are cut to 0 to this.
        unit: pixels of the full size to one of the truth, see `FULL_SIZE`.

    Returns:
        ``bad0.5 bad1.0 bad2.0 bad4.0``, percent of the pixels that count whose error is larger; ``totbad...``, the same
        with those that are not reported; ``invalid``, percent not reported; ``avgerr rms A50 A90 A95 A99`` of the
        reported ones, px of the full size. NaN where there is no pixel to speak of.

    Raises:
        StageError: If the sizes do not fit, or the mask is not bool.
    """
    counts = counted(truth, mask)
    found = _enlarged(disparity, truth, largest)[counts]
    errors = np.abs(found - truth[counts].astype(np.float32)) * np.float32(unit)
    reported = errors[np.isfinite(errors)]
    none = percentage(~np.isfinite(errors))
    bad = {threshold: percentage(np.where(np.isfinite(errors), errors > threshold, False)) for threshold in THRESHOLDS}
    return {
        **{f"bad{threshold:.1f}": share for threshold, share in bad.items()},
        **{f"totbad{threshold:.1f}": share + none for threshold, share in bad.items()},
        "invalid": none,
        **_of_reported(reported.astype(np.float64)),
    }


def weighted_mean(figures: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Return each figure's mean over training pairs, weighted as in the tables; `WEIGHTS` has all 15.

    Args:
        figures: by the name of the pair, a path's last part; with fewer than 15 the weights are of those there.

    Raises:
        StageError: If a pair is none of the 15, or there is none.

    >>> weighted_mean({"trainingQ/Teddy": {"bad2.0": 3.0}, "trainingQ/PianoL": {"bad2.0": 6.0}})
    {'bad2.0': 4.0}
    """
    named = {scene.rsplit("/", 1)[-1]: each for scene, each in figures.items()}
    strange = [scene for scene in named if scene not in WEIGHTS]
    if strange or not named:
        told = f"{strange[0]!r} is none of the 15 training pairs" if strange else "no pair is there"
        raise StageError(f"weighted mean of Middlebury: {told}")
    total = sum(WEIGHTS[scene] for scene in named)
    columns = next(iter(named.values()))
    return {name: sum(WEIGHTS[scene] * each[name] for scene, each in named.items()) / total for name in columns}


def _enlarged(disparity: NDArray[Any], truth: NDArray[Any], largest: float) -> NDArray[np.float32]:
    """Return the map in the truth's size, cut to the range searched, infinite where nothing is reported."""
    factor = max(1, truth.shape[1] // max(1, disparity.shape[1]))
    if factor not in (1, 2, 4):
        raise StageError(f"disparity has shape {disparity.shape}, the truth {truth.shape}: 1, 2 or 4 times is needed")
    large = np.repeat(np.repeat(disparity.astype(np.float32), factor, 0), factor, 1) * np.float32(factor)
    require_equal("disparity, enlarged,", large, truth)
    cut = np.clip(large, 0, np.float32(factor * largest))
    return np.where(np.isfinite(large), cut, np.float32(np.inf))


def _of_reported(errors: NDArray[np.float64]) -> dict[str, float]:
    if not errors.size:
        return dict.fromkeys(("avgerr", "rms", *QUANTILES), float("nan"))
    quantiles = np.quantile(errors, list(QUANTILES.values()), method="inverted_cdf").tolist()
    mean, rms = float(errors.mean()), float(np.sqrt(np.mean(errors**2)))
    return {"avgerr": mean, "rms": rms, **dict(zip(QUANTILES, quantiles, strict=True))}
