from dataclasses import replace

import numpy as np
import pytest

from semidense.stages.disparity.aggregation.levels import NO_COST, Levels
from semidense.stages.disparity.aggregation.strips import Strip
from semidense.stages.disparity.aggregation.winner import NONE, parabola, winner


def strip(sums: list[list[int]], d_min: int = 0, least: int = 0) -> Strip:
    """Return a row of pixels with these aggregated costs."""
    aggregated = np.array([sums], np.uint16)
    single = Levels(np.zeros(aggregated.shape, np.int16), np.full(aggregated.shape[:2], least, np.int16), d_min)
    return Strip(slice(0, 1), single, aggregated, aggregated)


@pytest.mark.parametrize(
    ("sums", "d_min", "expected"),
    [
        pytest.param([[9, 1, 1]] * 4, 0, [0, 1, 1, 1], id="of equal costs the smallest disparity; d <= x"),
        pytest.param([[1, 9, 0]] * 4, -2, [2, 2, 2, 2], id="a negative range"),
        pytest.param([[0, 9, 8]] * 4, -2, [0, 0, 2, 2], id="the right pixel is in the image"),
        pytest.param([[5, 4]] * 2, 9, [NONE, NONE], id="no right pixel is in the image"),
        pytest.param([[65535, 65535]] * 3, 0, [0, 0, 0], id="the largest sums"),
        pytest.param([[40000, 30000]] * 3, -1, [1, 1, 1], id="sums are not signed"),
        pytest.param([[3]], 0, [0], id="one cell"),
    ],
)
def test_by_hand(sums: list[list[int]], d_min: int, expected: list[int]) -> None:
    assert winner(strip(sums, d_min)).tolist() == [expected]


def test_a_pixel_without_any_cost_has_no_winner() -> None:
    assert winner(strip([[1, 2]] * 3, -1, least=int(NO_COST))).tolist() == [[NONE] * 3]


@pytest.mark.parametrize(
    ("sums", "index", "expected"),
    [
        pytest.param([4, 0, 4], 1, 0, id="symmetrical"),
        pytest.param([4, 0, 12], 1, -0.25, id="towards the lower side"),
        pytest.param([40000, 30000, 60000], 1, -0.25, id="sums are not signed"),
        pytest.param([0, 0, 8], 1, -0.5, id="at most half a pixel"),
        pytest.param([3, 3, 3], 1, 0, id="flat"),
        pytest.param([0, 1, 2], 0, 0, id="first of the range"),
        pytest.param([2, 1, 0], 2, 0, id="last of the range"),
        pytest.param([2, 1, 0], NONE, 0, id="no winner"),
    ],
)
def test_the_parabola_by_hand(sums: list[int], index: int, expected: float) -> None:
    made = parabola(strip([sums] * 9), np.full((1, 9), index, np.int32))
    assert made.dtype == np.float32 and made[0, 4] == expected


def test_the_parabola_needs_neighbours_in_the_image() -> None:
    assert parabola(strip([[4, 0, 12]] * 9), np.full((1, 9), 1, np.int32))[0, :3].tolist() == [0, 0, -0.25]


def test_the_parabola_goes_through_the_sums_of_the_first_pass() -> None:
    twice = replace(strip([[9, 9, 0, 9, 9]] * 9), first=strip([[4, 0, 2, 9, 9]] * 9).aggregated)
    assert winner(twice)[0, 8] == 2
    assert parabola(twice, winner(twice))[0, 8] == -0.5, "its lowest point lies 0.9 px to the left"
    level = replace(twice, first=strip([[9, 4, 0, 12, 9]] * 9).aggregated)
    assert parabola(level, winner(level))[0, 8] == -0.25
