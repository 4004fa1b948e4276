"""What is known of each pixel of another matcher's map: what the map looks like, and what our costs say of it."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from semidense.stages.compute.kernel import kernel
from semidense.stages.compute.precision import Precision
from semidense.stages.evaluation.agreement import padded_agreement
from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.features import network_log_odds
from semidense.stages.evaluation.evidence.foreign.cells import OFFSETS
from semidense.stages.evaluation.evidence.foreign.declaration import AGREEMENTS, MEANS, OF_CELLS
from semidense.stages.evaluation.evidence.foreign.likeness import distinctiveness, support
from semidense.stages.evaluation.evidence.foreign.overlap import overlap
from semidense.stages.evaluation.evidence.foreign.windows import window_mean
from semidense.stages.stage import Images, Network
from semidense.stages.transforms.gray import to_gray

LARGEST_STEP = 10.0
"""Steps beyond it are told alike, px."""


def features(
    images: Images,
    disparity: NDArray[np.float32],
    evaluation_net: Network,
    costs: NDArray[np.float32] | None,
    precision: Precision,
) -> NDArray[np.float32]:
    """Return the features of a map, of arrays with 50 px of context all round.

    Args:
        images: ``left`` (y + 100, x + 100, band) and ``moments``.
        disparity: (y + 100, x + 100) float32, px; NaN: none.
        evaluation_net: ``parameters``.
        costs: (cell, y + 100, x + 100) from ``Described.costs``; None without a right view.
        precision: arithmetic of the evaluation-Net.

    Returns:
        (feature, y, x) float32, in the order of ``FEATURES``, each as ``sign(v) ln(1 + |v|)``; 0 where
        nothing is known.
    """
    of_map = _of_map(images, disparity, evaluation_net, precision)
    of_cells = (
        np.zeros((len(OF_CELLS), *of_map.shape[1:]), np.float32) if costs is None else _of_cells(costs, disparity)
    )
    stacked = np.nan_to_num(np.concatenate([of_map, of_cells]))
    result: NDArray[np.float32] = np.sign(stacked) * np.log1p(np.abs(stacked))
    return result


def unscaled(feature: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what a feature was before ``sign(v) ln(1 + |v|)``."""
    result: NDArray[np.float32] = np.sign(feature) * np.expm1(np.abs(feature))
    return result


def _of_map(
    images: Images, disparity: NDArray[np.float32], evaluation_net: Network, precision: Precision
) -> NDArray[np.float32]:
    steps = np.minimum(_largest_step(disparity), np.float32(LARGEST_STEP))
    own = disparity[:, RADIUS:-RADIUS]
    hidden = np.pad(overlap(own), ((0, 0), (RADIUS, RADIUS)), mode="edge")
    known = np.isfinite(disparity).astype(np.float32)
    gray = to_gray(images["left"])
    distinct = distinctiveness(gray)
    column = np.arange(own.shape[1], dtype=np.float32) - own[RADIUS:-RADIUS]
    return np.stack(
        [
            network_log_odds(images, disparity, evaluation_net, precision),
            *(padded_agreement(disparity, side) for side in AGREEMENTS),
            *(window_mean(known, side) for side in MEANS),
            _middle(steps),
            *(window_mean(steps, side) for side in MEANS),
            _middle(hidden),
            *(window_mean((hidden > 1).astype(np.float32), side) for side in MEANS),
            np.minimum(column, np.float32(RADIUS)),
            _middle(_distance_to_step(steps)),
            support(disparity, gray),
            _middle(distinct),
            window_mean(distinct, MEANS[0]),
        ]
    )


def _of_cells(costs: NDArray[np.float32], disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    fraction = disparity - np.floor(disparity)  # NaN: no disparity, and no cost
    below, above = costs[-OFFSETS[0]], costs[1 - OFFSETS[0]]
    cost = np.where(fraction > 0, (1 - fraction) * below + fraction * above, below)
    excess = cost - np.fmin.reduce(costs)
    beside = (costs[0] + costs[-1]) / 2 - cost
    rival = np.pad(
        _rival(disparity[:, RADIUS:-RADIUS], cost[:, RADIUS:-RADIUS]), ((0, 0), (RADIUS, RADIUS)), mode="edge"
    )
    return np.stack(
        [
            *(_middle(cost), *(window_mean(cost, side) for side in MEANS)),
            *(_middle(excess), *(window_mean(excess, side) for side in MEANS)),
            _middle(beside),
            _middle(rival),
            window_mean(rival, MEANS[0]),
            np.ones_like(_middle(cost)),
        ]
    )


def _middle(block: NDArray[np.float32]) -> NDArray[np.float32]:
    return block[RADIUS:-RADIUS, RADIUS:-RADIUS]


def _distance_to_step(steps: NDArray[np.float32]) -> NDArray[np.float32]:
    is_smooth = steps <= 1  # a hole is not
    far = np.full(steps.shape, RADIUS) if is_smooth.all() else distance_transform_edt(is_smooth)
    nearest: NDArray[np.float32] = np.minimum(far, RADIUS).astype(np.float32)
    return nearest


def _largest_step(disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the largest difference to one of the four neighbours, px; NaN where there is no disparity."""
    steps = np.zeros_like(disparity)
    across, down = np.abs(np.diff(disparity, axis=1)), np.abs(np.diff(disparity, axis=0))
    for part, difference in (
        (steps[:, 1:], across),
        (steps[:, :-1], across),
        (steps[1:], down),
        (steps[:-1], down),
    ):
        np.fmax(part, difference, out=part)
    return np.where(np.isnan(disparity), np.float32(np.nan), steps)


def _rival(disparity: NDArray[np.float32], cost: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return by how much each cost lies above the least of the pixels that lead to the same right pixel, whole rows."""
    found = np.full(disparity.shape, np.nan, np.float32)
    for row, costs, told in zip(np.ascontiguousarray(disparity), np.ascontiguousarray(cost), found, strict=True):
        _write_rival(row, costs, told)
    return found


@kernel
def _write_rival(disparity: NDArray[np.float32], cost: NDArray[np.float32], told: NDArray[np.float32]) -> None:
    width = len(disparity)
    least = np.full(width, np.inf, np.float32)
    for x in range(width):
        if not np.isnan(cost[x]):
            seen = int(np.floor(x - disparity[x] + np.float32(0.5)))
            if 0 <= seen < width:
                least[seen] = min(least[seen], cost[x])
    for x in range(width):
        if not np.isnan(cost[x]):
            seen = int(np.floor(x - disparity[x] + np.float32(0.5)))
            if 0 <= seen < width:
                told[x] = cost[x] - least[seen]
