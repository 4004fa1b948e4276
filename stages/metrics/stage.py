"""The figures of one scene: the product ``metrics`` and its rows for machines."""

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.metrics.confidence import Ranking, optimal_auc
from semidense.stages.metrics.errors import QUANTILES, Errors, counted, require_equal
from semidense.stages.stage import Array, Arrays, Inputs, NoParams, Output, Stage

MASKS = ("nonocc", "all")
"""The order of the mask axis: pixels visible in both views, and all pixels; both only where the truth is known."""
THRESHOLDS = (0.5, 1.0, 2.0, 4.0)
"""The order of the threshold axis, px of the image at hand."""

FIGURES = {
    "pixels": ("int64", "1", "pixels of the mask with a known truth"),
    "raw_bad": ("float64", "%", "wrong or unreported pixels of the map before filtering"),
    "bad": ("float64", "%", "wrong pixels among those the filtered map reports"),
    "invalid": ("float64", "%", "pixels that the filtered map does not report"),
    "avgerr": ("float64", "px", "mean absolute error of the filtered map"),
    "rms": ("float64", "px", "root mean squared error of the filtered map"),
    **{
        name: ("float64", "px", f"error that {share:.0%} of the filtered map keep to")
        for name, share in QUANTILES.items()
    },
    "auc": ("float64", "1", "area under the error curve of the confidence over the map before filtering"),
    "auc_optimal": ("float64", "1", "the area that a perfect confidence would reach"),
}
"""The order of the figure axis; dtype, unit and meaning of each. Those that know no threshold are the same at each."""
_known: dict[bytes, list[list[dict[str, float]]]] = {}
"""Figures of maps before filtering, by a hash of all that they are made from."""
_MOST_KNOWN = 100

ROW = ("raw_bad", "bad", "invalid", "avgerr", "rms", "auc", "auc_optimal")
"""The figures of a machine-readable row, in order."""


def metric_rows(scene: str, method: str, R: float | None, arrays: Arrays) -> list[dict[str, Any]]:
    """Return the product as rows for scripts, one for each mask and threshold.

    Args:
        scene: name of the scene.
        method: name of the method that made the map.
        R: least confidence kept, None for a method that has none.
        arrays: the product ``metrics``.

    Returns:
        Rows ``scene, method, mask, threshold_px, R, pixels, raw_bad, bad, invalid, avgerr, rms, auc, auc_optimal``:
        errors in percent (0-100), ``avgerr`` and ``rms`` in px, areas as fractions. A key whose figure does not apply
        (NaN, or R None) is absent.
    """
    named = by_name(arrays["figures"])
    return [
        {"scene": scene, "method": method, "mask": mask, "threshold_px": threshold}
        | ({} if R is None else {"R": R})
        | {"pixels": int(named["pixels"][m, t])}
        | {name: float(named[name][m, t]) for name in ROW if not np.isnan(named[name][m, t])}
        for m, mask in enumerate(MASKS)
        for t, threshold in enumerate(THRESHOLDS)
    ]


def by_name(figures: Array) -> dict[str, Array]:
    """Return each of ``FIGURES``, in its own dtype, of an array (figure, mask, threshold)."""
    return {name: values.astype(about[0]) for (name, about), values in zip(FIGURES.items(), figures, strict=True)}


def compute_metrics(_: NoParams, inputs: Inputs) -> Arrays:
    """Compute the product ``metrics``: each of ``FIGURES`` for each of ``MASKS`` and ``THRESHOLDS``.

    Raises:
        StageError: if a map has not the shape of the ground truth.
    """
    maps = {
        "semidense": inputs["semidense"]["disparity"],
        "disparity": inputs["disparity"]["disparity"],
        "confidence": inputs["confidence"]["confidence"],
        "nonocc": inputs["truth"]["nonocc"],
    }
    truth: Array = inputs["truth"]["disparity"]
    for name, array in maps.items():
        require_equal(name, array, truth)
    masks = (maps.pop("nonocc"), np.ones(truth.shape, bool))
    semidense = maps.pop("semidense")
    raw = _raw_figures(**maps, truth=truth, masks=masks)
    table = [
        [cell | filtered for cell, filtered in zip(row, _filtered_figures(semidense, truth, mask), strict=True)]
        for row, mask in zip(raw, masks, strict=True)
    ]
    return {
        "figures": np.array([[[cell[name] for cell in row] for row in table] for name in FIGURES], np.float64),
    }


def _raw_figures(
    disparity: Array, confidence: Array, truth: Array, masks: Sequence[NDArray[np.bool_]]
) -> list[list[dict[str, float]]]:
    """Return the figures that no filtering changes, by mask and threshold.

    Ranking the pixels is most of the work, and a sweep over R asks for the same each time: what was worked
    out for these very arrays is taken again.
    """
    digest = hashlib.blake2b()
    for array in (disparity, confidence, truth, masks[0]):
        digest.update(f"{array.dtype}{array.shape}".encode())
        digest.update(array.tobytes())
    found = _known.get(digest.digest())
    if found is None:
        found = [_raw_of_mask(disparity, confidence, truth, mask) for mask in masks]
        if len(_known) >= _MOST_KNOWN:
            _known.clear()
        _known[digest.digest()] = found
    return found


def _raw_of_mask(disparity: Array, confidence: Array, truth: Array, mask: NDArray[np.bool_]) -> list[dict[str, float]]:
    """Return the figures of the map before filtering, at each threshold."""
    raw = Errors.of(disparity, truth, mask)
    ranking = Ranking.of(confidence[counted(truth, mask)])
    return [
        {
            "pixels": raw.absolute.size,
            "raw_bad": raw.raw_bad(threshold),
            "auc": ranking.auc(raw.absolute <= threshold),
            "auc_optimal": optimal_auc(raw.raw_bad(threshold) / 100),
        }
        for threshold in THRESHOLDS
    ]


def _filtered_figures(semidense: Array, truth: Array, mask: NDArray[np.bool_]) -> list[dict[str, float]]:
    """Return the figures of the filtered map, at each threshold."""
    filtered = Errors.of(semidense, truth, mask)
    same = {"invalid": filtered.invalid(), "avgerr": filtered.avgerr(), "rms": filtered.rms(), **filtered.quantiles()}
    return [same | {"bad": filtered.bad(threshold)} for threshold in THRESHOLDS]


_AXES = f"{', '.join(MASKS)}; wrong above {', '.join(f'{threshold:g}' for threshold in THRESHOLDS)} px"

METRICS = Stage(
    product="metrics",
    inputs=("semidense", "disparity", "confidence", "truth"),
    outputs=(
        # One array: as one each, the figures would take more time to store than to work out.
        Output("figures", ("figure", "mask", "threshold"), "float64", "1", f"{', '.join(FIGURES)}; of {_AXES}"),
    ),
    compute="semidense.stages.metrics.stage:compute_metrics",
)
"""The figures of a scene, in the order of ``FIGURES``, of ``MASKS`` and of ``THRESHOLDS``. ``truth`` has ``disparity``
(y, x) float32, NaN unknown, and ``nonocc`` (y, x) bool. Not tiled: a quantile and a ranking are not sums over tiles."""
