"""Maps from confidence to probability, fitted to a table of right and wrong pixels by confidence.

All rise strictly in the log-odds, so that the order of the pixels stays.

Source: Platt, "Probabilistic outputs for support vector machines", 1999; Zadrozny & Elkan, "Transforming classifier
scores into accurate multiclass probability estimates", KDD 2002 (isotonic).
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from semidense.stages.evaluation.calibration.declaration import BINS, MAPS
from semidense.stages.evaluation.calibration.table import EDGES, Floats, Table, log_odds, probability

Fit = Callable[[Table], Floats]
"""Makes a map from a table: calibrated log-odds at ``EDGES``, strictly rising."""
_CENTRES = (EDGES[1:] + EDGES[:-1]) / 2
_ROUNDS = 50
_LEAST_STEP = 1e-9
"""By which calibrated log-odds rise at least from edge to edge, so that no two confidences become one."""
_DOUBT = 1e-5
"""Share of a scene's pixels by which each pool is held to have one more right and wrong: none is certain."""


def fit_nothing(_: Table) -> Floats:
    """Return the map that changes nothing."""
    return EDGES.copy()


def fit_platt(table: Table) -> Floats:
    """Return Platt's map: log-odds ``a z + b`` of the highest likelihood (Newton's method); a is above 0."""
    right, wrong = table.shares
    features = np.stack([_CENTRES, np.ones(BINS)])
    solution = np.array([1.0, 0.0])
    for _ in range(_ROUNDS):
        expected = probability(solution @ features)
        gradient = features @ (right - (right + wrong) * expected)
        curvature = (features * ((right + wrong) * expected * (1 - expected))) @ features.T
        step = np.linalg.solve(curvature + 1e-9 * np.eye(2), gradient)
        solution = solution + np.clip(step, -1, 1)
    slope, offset = max(solution[0], 1e-3), solution[1]
    mapped: Floats = slope * EDGES + offset
    return mapped


def fit_isotonic(table: Table) -> Floats:
    """Return the rising map that fits best: pooled neighbours, straight lines in log-odds between them.

    Below the first and above the last pool it goes on as log-odds do, one for one.
    """
    right, wrong = table.shares
    used = right + wrong > 0
    pools = _pooled(right[used], wrong[used], _CENTRES[used])
    if not pools:
        return EDGES.copy()
    values = np.array([np.log(r + _DOUBT) - np.log(w + _DOUBT) for r, w, _ in pools])
    centres = np.array([centre / (r + w) for r, w, centre in pools])
    values = np.maximum.accumulate(values)
    mapped = np.interp(EDGES, centres, values)
    mapped += np.minimum(EDGES - centres[0], 0) + np.maximum(EDGES - centres[-1], 0)
    rising: Floats = np.maximum.accumulate(mapped) + _LEAST_STEP * np.arange(EDGES.size)
    return rising


def _pooled(right: Floats, wrong: Floats, centres: Floats) -> list[tuple[float, float, float]]:
    """Pool neighbours until the share of right pixels rises (pool adjacent violators).

    Returns:
        Right, wrong, and the sum of the centres weighted with both, of each pool.
    """
    pools: list[tuple[float, float, float]] = []
    for r, w, centre in zip(right, wrong, centres, strict=True):
        pool = (float(r), float(w), float((r + w) * centre))
        while pools and pools[-1][0] * pool[1] >= pool[0] * pools[-1][1]:
            pool = tuple(a + b for a, b in zip(pools.pop(), pool, strict=True))  # type: ignore[assignment]
        pools.append(pool)
    return pools


FITS: dict[str, Fit] = dict(zip(MAPS, (fit_nothing, fit_platt, fit_isotonic), strict=True))
"""How each of ``MAPS`` is fitted."""


def brier_score(table: Table, mapped: Floats) -> float:
    """Return the mean squared difference of probability and outcome (1 right, 0 wrong), each scene weighing the same.

    A proper score: no other probabilities than the true ones have a lower expectation.
    """
    right, wrong = table.shares
    expected = probability((mapped[1:] + mapped[:-1]) / 2)
    return float((right * (1 - expected) ** 2 + wrong * expected**2).sum() / max((right + wrong).sum(), 1e-12))


def cross_validate(table: Table, folds: NDArray[np.integer], fit: Fit) -> float:
    """Return the Brier score of a map on scenes that it was not fitted to; mean over the folds' scenes."""
    scores = []
    for fold in np.unique(folds):
        held_out = folds == fold
        scores += [brier_score(table.scenes(held_out), fit(table.scenes(~held_out)))] * int(held_out.sum())
    return float(np.mean(scores))


def calibrate(confidence: NDArray[np.float32], mapped: Floats) -> NDArray[np.float32]:
    """Return calibrated probabilities.

    Args:
        confidence: any shape, in [0, 1], NaN where there is none.
        mapped: calibrated log-odds at ``EDGES``; beyond them they go on one for one.

    Returns:
        float32 of the same shape; the order of the values is that of ``confidence``.
    """
    odds = log_odds(confidence)
    inside = np.clip(odds, EDGES[0], EDGES[-1])
    beyond = np.where(np.isnan(odds), np.nan, odds - inside)
    result: NDArray[np.float32] = probability(np.interp(inside, EDGES, mapped) + beyond).astype(np.float32)
    return result
