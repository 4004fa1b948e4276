"""The figures of one scene: the product ``metrics`` and its rows for machines."""

from collections.abc import Sequence
from typing import Any, TypedDict

import numpy as np

from semidense.stages.metrics.errors import MASKS, QUANTILES, THRESHOLDS, Errors, pixels_of, require_equal
from semidense.stages.metrics.ranking import AXES, DIMS, RANKED, Figures
from semidense.stages.stage import Array, Arrays, DisparityMap, NoParams, Output, Stage, Truth

FIGURES = ("pixels", "raw_bad", "bad", "invalid", "avgerr", "rms", *QUANTILES, "auc", "auc_optimal")
"""The order of the figure axis. Those that know no threshold are the same at each."""
ROW = tuple(name for name in FIGURES if name not in ("pixels", *QUANTILES))
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


def by_name(figures: Array, names: Sequence[str] = FIGURES) -> dict[str, Array]:
    """Return each figure of an array (figure, mask, threshold) by its name; ``pixels`` as int64."""
    found = dict(zip(names, figures, strict=True))
    return found | {"pixels": found["pixels"].astype(np.int64)}


class Filtered(TypedDict):
    """The filtered map, the truth, and the figures of the map before filtering."""

    semidense: DisparityMap
    truth: Truth
    ranking: Figures


def compute_metrics(_: NoParams, inputs: Filtered) -> Figures:
    """Compute the product ``metrics``: each of ``FIGURES`` for each of ``MASKS`` and ``THRESHOLDS``.

    Raises:
        StageError: if the map has not the shape of the ground truth.
    """
    semidense, truth = inputs["semidense"]["disparity"], inputs["truth"]["disparity"]
    require_equal("semidense", semidense, truth)
    kept = [_kept(Errors.of(semidense, truth, mask)) for mask in pixels_of(inputs["truth"]["nonocc"])]
    figures = dict(zip(RANKED, inputs["ranking"]["figures"], strict=True))
    figures |= {name: np.array([each[name] for each in kept]) for name in kept[0]}
    return {"figures": np.array([figures[name] for name in FIGURES], np.float64)}


def _kept(errors: Errors) -> dict[str, list[float]]:
    """Return each figure of the filtered map, at each threshold."""
    same = {"invalid": errors.invalid(), "avgerr": errors.avgerr(), "rms": errors.rms(), **errors.quantiles()}
    at_each = {name: [value] * len(THRESHOLDS) for name, value in same.items()}
    return at_each | {"bad": [errors.bad(threshold) for threshold in THRESHOLDS]}


METRICS = Stage(
    product="metrics",
    inputs=("semidense", "truth", "ranking"),
    # One array: as one each, the figures would take more time to store than to work out.
    outputs=(Output("figures", DIMS, "float64", "1", f"{', '.join(FIGURES)}; {AXES}"),),
    compute="semidense.stages.metrics.stage:compute_metrics",
)
"""The figures of a scene before and after filtering. ``truth`` as of ``RANKING``. Not tiled: a quantile is not a sum
over tiles."""
