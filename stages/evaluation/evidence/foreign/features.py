"""What is known of each pixel of another matcher's map: what the map looks like, and what our costs say of it."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.compute.precision import Precision
from semidense.stages.evaluation.declaration import RADIUS
from semidense.stages.evaluation.evidence.declaration import MEANS
from semidense.stages.evaluation.evidence.foreign.cells import OFFSETS
from semidense.stages.evaluation.evidence.foreign.declaration import OF_CELLS
from semidense.stages.evaluation.evidence.of_map import compressed, middle, of_map
from semidense.stages.evaluation.evidence.windows import window_mean
from semidense.stages.stage import Images, Network


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
    from_map = of_map(images, disparity, evaluation_net, precision)
    of_cells = (
        np.zeros((len(OF_CELLS), *from_map.shape[1:]), np.float32) if costs is None else _of_cells(costs, disparity)
    )
    return compressed(np.concatenate([from_map, of_cells]))


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
            *(middle(cost), *(window_mean(cost, side) for side in MEANS)),
            *(middle(excess), *(window_mean(excess, side) for side in MEANS)),
            middle(beside),
            middle(rival),
            window_mean(rival, MEANS[0]),
            np.ones_like(middle(cost)),
        ]
    )


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
