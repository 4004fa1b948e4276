"""How good a disparity map is, and how well a confidence tells its right pixels from its wrong ones."""

from semidense.stages.metrics.confidence import ErrorCurve, Ranking, auc, error_at_density, error_curve, optimal_auc
from semidense.stages.metrics.errors import QUANTILES, Errors, avgerr, bad, error_quantiles, invalid, raw_bad, rms
from semidense.stages.metrics.stage import MASKS, METRICS, THRESHOLDS, metric_rows

__all__ = [
    "MASKS",
    "METRICS",
    "QUANTILES",
    "THRESHOLDS",
    "ErrorCurve",
    "Errors",
    "Ranking",
    "auc",
    "avgerr",
    "bad",
    "error_at_density",
    "error_curve",
    "error_quantiles",
    "invalid",
    "metric_rows",
    "optimal_auc",
    "raw_bad",
    "rms",
]
