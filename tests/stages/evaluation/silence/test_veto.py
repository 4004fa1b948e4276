"""A flat cost curve, or several equally good minima, cannot score high, whatever the map looks like."""

import numpy as np
import pytest

from semidense.stages.evaluation.silence.cost_margin import cost_margin
from semidense.stages.evaluation.silence.veto import repetitive, undecided

HEIGHT, WIDTH, DEPTH = 20, 24, 40


def padded(values: np.ndarray) -> np.ndarray:
    return np.pad(values, 50, mode="edge")


def curves(*winners: int, depth: float = 6, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """Costs that fall by ``depth`` at the winners, with some noise."""
    costs = np.random.default_rng(seed).normal(0, noise, (HEIGHT, WIDTH, DEPTH))
    costs[..., list(winners)] -= depth
    return costs.astype(np.float16)


@pytest.mark.parametrize(
    "costs",
    [
        pytest.param(curves(), id="flat"),
        pytest.param(curves(noise=0.3), id="flat but for noise"),
        pytest.param(curves(7, 19), id="two minima"),
        pytest.param(curves(7, 13, 19, 25, 31, noise=0.3), id="a period of 6 px, with noise"),
        pytest.param(np.full((HEIGHT, WIDTH, DEPTH), np.nan, np.float16), id="no valid cost"),
    ],
)
def test_no_pixel_is_decided(costs: np.ndarray) -> None:
    assert undecided(padded(cost_margin(costs))).all()


def test_one_minimum_decides() -> None:
    assert not undecided(padded(cost_margin(curves(7, noise=0.3)))).any()
    assert not undecided(padded(cost_margin(curves(7, 8, noise=0.3)))).any(), "neighbours are one minimum"


def test_one_tie_among_clear_winners_is_undecided_alone() -> None:
    margin = np.full((HEIGHT, WIDTH), 6, np.float32)
    margin[4, 5] = 0.05
    assert np.argwhere(undecided(padded(margin))).tolist() == [[4, 5]]


def test_a_view_without_texture_speaks_for_its_own_pixels_and_the_right_one_for_those_matched_to_it() -> None:
    left, right = np.full((2, 6, 9), 3, np.float32)
    left[1, 2] = right[4, 5] = 0.5
    disparity = np.zeros((6, 9), np.float32)
    disparity[4, 7], disparity[4, 5], disparity[4, 3], disparity[4, 8] = 2.4, 1, -2, np.nan
    found = repetitive(padded(left), padded(right), padded(disparity))
    assert np.argwhere(found).tolist() == [[1, 2], [4, 3], [4, 7]]
