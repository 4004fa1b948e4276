import numpy as np
import pytest
from numpy.typing import NDArray

from semidense.stages.disparity.aggregation.median import median

NAN = float("nan")


def a_map(*rows: list[float]) -> NDArray[np.float32]:
    return np.array(rows, np.float32)


def inside(*rows: list[float]) -> list[list[float]]:
    """Return the medians of a map amid so wide a view that all its disparities meet a right pixel."""
    wide = np.pad(a_map(*rows), ((0, 0), (100, 0)), constant_values=NAN)
    found: list[list[float]] = median(wide, 3)[:, 100:].tolist()
    return found


@pytest.mark.parametrize("side", [3, 5])
def test_inside_it_is_the_median_of_the_window(side: int) -> None:
    view = np.random.default_rng(3).uniform(size=(12, 13)).astype(np.float32)
    windows = np.lib.stride_tricks.sliding_window_view(view, (side, side))
    inside = slice(side // 2, -(side // 2))
    np.testing.assert_array_equal(median(view, side)[inside, inside], np.median(windows, (2, 3)))


def test_a_single_outlier_goes_and_an_edge_stays() -> None:
    view = np.repeat(a_map([3, 3, 3, 20, 20, 20]), 6, 0).tolist()
    spoilt = [list(row) for row in view]
    spoilt[2][1], spoilt[4][5] = 50, 0
    assert inside(*spoilt) == view


def test_a_side_of_one_changes_nothing() -> None:
    view = a_map([1, NAN, 9], [4, 2, 7])
    np.testing.assert_array_equal(median(view, 1), view)


def test_unknown_pixels_stay_unknown_and_do_not_count() -> None:
    given = [[1, NAN, NAN], [NAN, NAN, 8], [2, NAN, 30]]
    np.testing.assert_array_equal(inside(*given), given)


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        pytest.param([[10, 20]], [[10, 20]], id="its own is one of the two in the middle"),
        pytest.param([[50, 20, 10, 40]], [[50, 20, 20, 40]], id="an odd number has a middle"),
        pytest.param([[40, 10], [20, 30]], [[30, 20], [20, 30]], id="the nearer of the two in the middle"),
    ],
)
def test_of_an_even_number_no_mean_comes_out(rows: list[list[float]], expected: list[list[float]]) -> None:
    assert inside(*rows) == expected


def test_a_median_that_leads_out_of_the_other_view_is_not_taken() -> None:
    view = np.repeat(a_map([5, 1, 5, 5, 5, 1, 5, 5]), 5, 0)
    assert median(view, 3)[2, :6].tolist() == [5, 1, 5, 5, 5, 5]
    assert median(-view[:, ::-1], 3)[2, 2:].tolist() == [-5, -5, -5, -5, -1, -5]
