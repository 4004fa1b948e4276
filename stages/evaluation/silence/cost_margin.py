"""Maximum margin: by how much the best rival of the cheapest disparity costs more."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.compute.kernel import kernel
from semidense.stages.evaluation.silence.declaration import LARGEST_MARGIN, CostMargin
from semidense.stages.stage import NoParams, OfVolume, require_shape


def cost_margin(costs: NDArray[Any]) -> NDArray[np.float32]:
    """Return how much more than the least cost the least of the other disparities costs, the two beside it left out.

    Args:
        costs: (y, x, d) float16 or float32, log-odds of a mismatch; NaN is an invalid cell, infinity a valid cost.

    Returns:
        (y, x) float32 in [0, 40]: 0 where another disparity costs as little, 40 where none is valid; NaN where no cost
        is.

    Raises:
        StageError: if the volume has not three dimensions.

    Source: the "maximum margin" of Hu & Mordohai, "A quantitative evaluation of confidence measures for stereo
    vision", PAMI 2012.

    >>> cost_margin(np.float32([[[-3, -4, -3.5, 1, -2]], [[2, 2, 2, 2, 2]]])).tolist()
    [[2.0], [0.0]]
    """
    require_shape("the cost volume", costs, 3)
    margin = np.empty(costs.shape[:2], np.float32)
    _write_margin(np.ascontiguousarray(costs, np.float32), np.float32(LARGEST_MARGIN), margin)
    return margin


@kernel
def _write_margin(costs: NDArray[np.float32], largest: np.float32, margin: NDArray[np.float32]) -> None:
    height, width, depth = costs.shape
    for y in range(height):
        for x in range(width):
            best, least = -1, np.float32(np.inf)
            for d in range(depth):
                if costs[y, x, d] < least or (best < 0 and costs[y, x, d] == least):
                    best, least = d, costs[y, x, d]
            other, rival = -1, np.float32(np.inf)
            for d in range(depth):
                if abs(d - best) > 1 and costs[y, x, d] <= rival:
                    other, rival = d, costs[y, x, d]
            if best < 0:
                margin[y, x] = np.float32(np.nan)
            else:
                margin[y, x] = largest if other < 0 else _difference(least, rival, largest)


@kernel
def _difference(least: np.float32, rival: np.float32, largest: np.float32) -> np.float32:
    """Return by how much the rival costs more; 0 if both are infinite."""
    return np.float32(0) if rival == least else min(rival - least, largest)


def compute_cost_margin(_: NoParams, inputs: OfVolume) -> CostMargin:
    """Compute the product ``cost_margin``; see ``cost_margin``."""
    return {"margin": cost_margin(inputs["costvolume"]["cost"])}
