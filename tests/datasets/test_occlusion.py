import numpy as np
import pytest

from semidense.datasets.occlusion import left_right_check, warped_truth_mask
from tests.stages.left_right import CASES

NAN = np.nan
YES, NO = True, False


def row(*values: float) -> np.ndarray:
    return np.array([values], np.float32)


@pytest.mark.parametrize(("left", "right", "confirmed"), CASES)
def test_left_right_check_by_hand(left: list[float], right: list[float], confirmed: list[bool]) -> None:
    assert left_right_check(row(*left), row(*right)).tolist() == [confirmed]


def test_left_right_check_takes_a_tolerance() -> None:
    assert left_right_check(row(0, 0), row(0.25, 0.5), tolerance=0.25).tolist() == [[YES, NO]]


@pytest.mark.parametrize(
    "left, expected",
    [
        pytest.param(row(0, 0, 0), [YES, YES, YES], id="flat"),
        pytest.param(row(2, 2, 2), [NO, NO, YES], id="lands outside"),
        pytest.param(row(0, 0, 0, 2, 2, 0), [YES, NO, NO, YES, YES, YES], id="covered by a nearer pixel"),
        pytest.param(row(NAN, NAN, NAN), [NO, NO, NO], id="nothing known"),
        pytest.param(row(0, 0, 0, NAN, NAN), [YES, YES, YES, NO, NO], id="unknown covers nothing"),
        pytest.param(row(0, 0.5, 1, 1.5, 2, 2.5), [YES] * 6, id="a slanted surface does not cover itself"),
        pytest.param(row(0, 0, 0, 0, 1.5, 1.5), [YES, YES, NO, NO, YES, YES], id="between columns both are covered"),
    ],
)
def test_warped_truth_by_hand(left: np.ndarray, expected: list[bool]) -> None:
    assert warped_truth_mask(left).tolist() == [expected]


def test_rows_do_not_mix() -> None:
    both = np.concatenate([row(0, 0, 0, 2, 2), row(0, 0, 0, 0, 0)])
    assert warped_truth_mask(both).tolist() == [[YES, NO, NO, YES, YES], [YES] * 5]
    assert left_right_check(both, both)[1].all()
