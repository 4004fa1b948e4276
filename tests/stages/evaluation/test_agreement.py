import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from semidense.stages.evaluation.agreement import agreement
from semidense.stages.stage import StageError

N = np.nan


@pytest.mark.parametrize(
    ("disparity", "expected"),
    [
        pytest.param([[4, 4], [4, 4]], [[9, 9], [9, 9]], id="one surface, and beyond the image the nearest pixel"),
        pytest.param([[4, 5], [4, 5]], [[9, 9], [9, 9]], id="1 px still agrees"),
        pytest.param([[4, 5.25], [4, 5.25]], [[6, 6], [6, 6]], id="more does not"),
        pytest.param([[4, 4, 4], [4, 9, 4], [4, 4, 4]], [[8, 8, 8], [8, 1, 8], [8, 8, 8]], id="alone"),
        pytest.param([[4, N], [4, N]], [[6, 1], [6, 1]], id="none agrees with nothing"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_counts_by_hand(disparity: list[list[float]], expected: list[list[int]]) -> None:
    made = agreement(np.float32(disparity), window=3)
    assert made.dtype == np.float32
    assert (made * 9).round(3).tolist() == expected


@settings(max_examples=25, deadline=None)
@given(
    disparity=arrays(np.float32, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.integers(0, 4)),
    window=st.sampled_from([1, 3, 5, 7]),
)
def test_equals_a_literal_count(disparity: np.ndarray, window: int) -> None:
    radius = window // 2
    padded = np.pad(disparity, radius, mode="edge")
    views = np.lib.stride_tricks.sliding_window_view(padded, (window, window))
    literal = (np.abs(views - disparity[:, :, None, None]) <= 1).mean((2, 3))
    assert np.abs(agreement(disparity, window) - literal).max() <= 1e-7


@pytest.mark.parametrize("window", [0, 2, 103])
def test_refuses_a_window(window: int) -> None:
    with pytest.raises(StageError, match=f"the window of the agreement is {window} px"):
        agreement(np.zeros((4, 4), np.float32), window)


def test_refuses_what_is_no_map() -> None:
    with pytest.raises(StageError, match="disparity has shape"):
        agreement(np.zeros(4, np.float32), 3)
