import numpy as np
import pytest
import torch

from semidense.stages.disparity.aggregation.differentiable import path_sums
from semidense.stages.disparity.aggregation.edges import penalties
from semidense.stages.disparity.aggregation.levels import SCALE
from semidense.stages.disparity.aggregation.strips import aggregate
from semidense.stages.disparity.declaration import AggregatedParams

PARAMS = AggregatedParams(p1=3, oblique=0.5, p2=11, edge=4)
TABLE = (penalties(PARAMS) / SCALE).astype(np.float32)


def view(shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).choice([10, 16, 17, 200], shape).astype(np.uint8)


def test_by_hand() -> None:
    """Two pixels of a row, P1 = 1 and P2 = 2. From the left: 5 + min(0, 3 + 1, 2) = 5, and 0 + min(3, 0 + 1) = 1."""
    costs = torch.tensor([[[0.0, 3.0], [5.0, 0.0]]])
    made = path_sums(costs, np.zeros((1, 2), np.uint8), np.ones((2, 256, 2), np.float32) * np.float32([1, 2]))
    # From the right the first pixel has 0 + min(5, 0 + 1) = 1 and 3; the six other paths begin at each pixel.
    assert made.tolist() == [[[7 * 0 + 1, 7 * 3 + 3], [7 * 5 + 5, 7 * 0 + 1]]]


@pytest.mark.parametrize("shape", [(6, 7, 5), (1, 9, 4), (9, 1, 4), (3, 2, 40), (1, 1, 1)])
def test_the_sums_of_whole_levels_are_those_of_a_map(shape: tuple[int, int, int]) -> None:
    costs = np.random.default_rng(1).integers(0, 150, shape).astype(np.float16) / SCALE
    gray = view(shape[:2])
    (strip,) = aggregate(costs, gray, -50, PARAMS, rows=shape[0])
    made = path_sums(torch.from_numpy(strip.single.above / np.float32(SCALE)), gray, TABLE)
    assert np.array_equal(made.numpy() * SCALE, strip.aggregated)


def test_the_gradient_is_what_a_small_change_of_a_cost_changes() -> None:
    """Each sum is linear in the costs until another way becomes the best; there its two sides differ."""
    shape, step = (5, 6, 4), 1 / 256
    rng = np.random.default_rng(2)
    costs = torch.from_numpy(rng.uniform(0, 30, shape)).float().requires_grad_()
    weights = torch.from_numpy(rng.normal(size=shape)).float()

    def total(given: torch.Tensor) -> float:
        return float((path_sums(given, view(shape[:2]), TABLE).double() * weights).sum())

    (path_sums(costs, view(shape[:2]), TABLE) * weights).sum().backward()
    compared = 0
    for cell in np.ndindex(*shape):
        change = torch.zeros(shape)
        change[cell] = step
        with torch.no_grad():
            here = total(costs)
            sides = (total(costs + change) - here) / step, (here - total(costs - change)) / step
        if abs(sides[0] - sides[1]) < 0.01:
            compared += 1
            assert float(costs.grad[cell]) == pytest.approx(sides[0], abs=0.02), cell
    assert compared > 0.9 * np.prod(shape)
