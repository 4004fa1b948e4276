import numpy as np
import pytest

from semidense.stages.baselines.window import box_mean, keep_consistent


def test_a_window_is_cut_at_the_border() -> None:
    values = np.arange(12, dtype=np.float32).reshape(3, 4)
    assert box_mean(values, 1)[0, 0] == values[:2, :2].mean()
    assert box_mean(values, 1)[1, 1] == values[:3, :3].mean()
    np.testing.assert_array_equal(box_mean(values, 0), values)


@pytest.mark.parametrize(
    ("left", "right", "kept"),
    [
        pytest.param([0, 1, 1], [1, 0, 0], [np.nan, 1, np.nan], id="the views must agree"),
        pytest.param([np.nan, np.nan, 2], [2, 0, 0], [np.nan, np.nan, 2], id="unknown stays unknown"),
        pytest.param([0, 0, 0], [np.nan, 0, 0], [np.nan, 0, 0], id="no answer from the right view"),
    ],
)
def test_only_what_both_views_say_is_kept(left: list[float], right: list[float], kept: list[float]) -> None:
    found = keep_consistent(np.array([left], np.float32), np.array([right], np.float32), 0.5)
    np.testing.assert_array_equal(found[0], np.array(kept, np.float32))
