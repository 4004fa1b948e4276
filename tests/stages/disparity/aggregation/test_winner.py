from dataclasses import replace

import numpy as np
import pytest

from semidense.stages.disparity.aggregation.levels import NO_COST, Levels
from semidense.stages.disparity.aggregation.strips import Strip
from semidense.stages.disparity.aggregation.winner import NONE, v_fit, winner


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
        pytest.param([5, 1, 13], 1, np.float32(-1 / 3), id="towards the lower side"),
        pytest.param([40000, 30000, 60000], 1, np.float32(-1 / 3), id="sums are not signed"),
        pytest.param([0, 0, 8], 1, -0.5, id="as low on one side"),
        pytest.param([0, 2, 8], 1, -0.5, id="lower on one side: at most half a pixel"),
        pytest.param([0, 2, 1], 1, 0, id="lower on both sides"),
        pytest.param([3, 3, 3], 1, 0, id="flat"),
        pytest.param([0, 1, 2], 0, 0, id="first of the range"),
        pytest.param([2, 1, 0], 2, 0, id="last of the range"),
        pytest.param([2, 1, 0], NONE, 0, id="no winner"),
    ],
)
def test_the_v_by_hand(sums: list[int], index: int, expected: float) -> None:
    made = v_fit(strip([sums] * 9), np.full((1, 9), index, np.int32))
    assert made.dtype == np.float32 and made[0, 4] == expected


def test_the_v_needs_neighbours_in_the_image() -> None:
    assert v_fit(strip([[4, 0, 8]] * 9), np.full((1, 9), 1, np.int32))[0, :3].tolist() == [0, 0, -0.25]


def test_the_v_goes_through_the_sums_of_both_passes() -> None:
    twice = replace(strip([[9, 9, 0, 9, 9]] * 9), first=strip([[4, 0, 7, 14, 9]] * 9).aggregated)
    assert winner(twice)[0, 8] == 2
    assert v_fit(twice, winner(twice))[0, 8] == np.float32(-14 / 32)
