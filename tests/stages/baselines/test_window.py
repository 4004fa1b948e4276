import numpy as np

from semidense.stages.baselines.window import box_mean, match_windows


def test_a_window_is_cut_at_the_border() -> None:
    values = np.arange(12, dtype=np.float32).reshape(3, 4)
    assert box_mean(values, 1)[0, 0] == values[:2, :2].mean()
    assert box_mean(values, 1)[1, 1] == values[:3, :3].mean()
    np.testing.assert_array_equal(box_mean(values, 0), values)


def test_what_the_right_view_contradicts_is_dropped_never_read_from_the_other_end() -> None:
    """Columns 0 and 1 match best at a disparity that the right view gives to others."""
    costs = {0: np.float32([[5, 5, 5, 5]]), 1: np.float32([[1, 1, 9]])}
    found = match_windows(lambda d, columns, seen: costs[d], (1, 4), range(2), 1, 0.5)
    assert found["dense"].tolist() == [[0, 1, 1, 0]]
    assert np.array_equal(found["disparity"], np.float32([[np.nan, 1, 1, 0]]), equal_nan=True)
