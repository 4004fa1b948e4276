import numpy as np
import pytest

from semidense.stages.disparity.depth import depth, points
from semidense.stages.stage import StageError


def test_depth_is_middleburys_formula() -> None:
    made = depth(np.float32([[0, 20, -31, -40, np.nan]]), focal=994.978, baseline=0.193001, doffs=31.086)
    assert np.allclose(made[0, :2], [994.978 * 0.193001 / 31.086, 994.978 * 0.193001 / 51.086])
    assert made[0, 2] > 2000, "nearly at infinity"
    assert np.isnan(made[0, 3:]).all(), "beyond infinity, and none"


@pytest.mark.parametrize(("focal", "baseline"), [(0, 1), (1, 0), (-1, 1), (np.nan, 1)])
def test_cameras_that_see_no_depth_are_refused(focal: float, baseline: float) -> None:
    with pytest.raises(StageError, match="above 0"):
        depth(np.zeros((1, 1)), focal, baseline)


def test_points_lie_right_side_up() -> None:
    distance = np.full((3, 3), np.nan, np.float32)
    distance[0, 2] = distance[2, 0] = 4
    upper_right, lower_left = points(distance, 2, (1, 1))
    assert upper_right.tolist() == [2, 2, -4]
    assert lower_left.tolist() == [-2, -2, -4]


def test_points_project_back_to_their_pixels() -> None:
    distance = np.random.default_rng(0).uniform(1, 9, (4, 5)).astype(np.float32)
    x, y, z = points(distance, 300, (2.5, 1.5)).T
    assert np.allclose(-x / z * 300 + 2.5, np.tile(np.arange(5), 4), atol=1e-4)
    assert np.allclose(y / z * 300 + 1.5, np.repeat(np.arange(4), 5), atol=1e-4)
