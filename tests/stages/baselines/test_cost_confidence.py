import numpy as np
import pytest

from semidense.stages.baselines.cost_confidence import EPSILON, cost_confidence
from semidense.stages.baselines.declaration import COST_CONFIDENCE, CostConfidenceParams
from semidense.stages.disparity.winner_takes_all import winner_take_all
from semidense.stages.stage import StageError
from tests.stages.tiling import same, tiled, whole

NAN = np.nan


def log_odds(costs: object) -> np.ndarray:
    """Return the log-odds whose positive cost ``ln(1 + exp(z))`` is given."""
    return np.log(np.expm1(np.array(costs, np.float64))).astype(np.float32)


def volume(height: int = 20, width: int = 18, depth: int = 6) -> np.ndarray:
    """Return a random volume whose cells beyond the right view's left border are invalid, as in a real one."""
    costs = np.random.default_rng(0).normal(0, 3, (height, width, depth)).astype(np.float16)
    for x in range(depth):
        costs[:, x, x + 1 :] = NAN
    return costs


def test_one_row_by_hand() -> None:
    # Only the last pixel sees all three disparities 0, 1, 2; its right pixels are 2, 1 and 0.
    row = [[4, NAN, NAN], [5, 3, NAN], [1, 6, 2]]
    found = cost_confidence(log_odds([row]), d_min=0, window=1)
    assert found["msm"][0].tolist() == pytest.approx([-4, -3, -1], rel=1e-5)
    assert found["pkrn"][0, 1:].tolist() == pytest.approx([(5 + EPSILON) / (3 + EPSILON), 2], rel=1e-2)
    assert found["apkr"][0, 2] == pytest.approx(2, rel=1e-2), "2 is a local minimum, 6 is not"
    # Pixel 1 wins at d = 1 with 3; right pixel 0 is seen at 4, 3 and 2: its least cost is 2.
    assert found["lrd"][0, 1] == pytest.approx((5 - 3) / (3 - 2), rel=1e-2)
    assert np.isnan([found[name][0, 0] for name in ("pkrn", "apkr", "lrd")]).all(), "there is no second disparity"


def test_the_rival_of_the_peak_ratio_is_a_local_minimum() -> None:
    costs = np.full((1, 9, 5), NAN)
    costs[0, 8] = [9, 4, 1, 2, 3]  # 2 and 3 climb from the winner; 9 is an end above its neighbour
    assert cost_confidence(log_odds(costs), 0, 1)["apkr"][0, 8] == pytest.approx(2, rel=1e-2), "none: the second least"
    costs[0, 8] = [3, 4, 1, 2, 9]
    assert cost_confidence(log_odds(costs), 0, 1)["apkr"][0, 8] == pytest.approx(3, rel=1e-2)


def test_the_average_takes_the_disparities_of_the_centre() -> None:
    costs = np.full((1, 6, 3), NAN)
    costs[0, 4], costs[0, 5] = [1, 5, 2], [8, 5, 2]
    expected = np.mean([2 / 1, 2 / 8])
    assert cost_confidence(log_odds(costs), 0, 3)["apkr"][0, 4] == pytest.approx(expected, rel=1e-2)


def test_a_pixel_without_a_valid_cost_has_no_confidence() -> None:
    found = cost_confidence(np.full((2, 3, 4), NAN, np.float16), 0, 5)
    assert all(np.isnan(array).all() and array.dtype == np.float32 for array in found.values())


def test_the_winner_is_that_of_the_raw_map() -> None:
    costs = volume()
    index = winner_take_all(costs, 0).astype(int)
    least = np.take_along_axis(costs, index[..., None], 2)[..., 0].astype(np.float32)
    np.testing.assert_allclose(cost_confidence(costs, 0, 5)["msm"], -np.logaddexp(np.float32(0), least), rtol=1e-6)


@pytest.mark.parametrize("rows", [3, 8], ids=lambda rows: f"tiles of {rows} rows")
def test_tiles_give_what_the_whole_image_gives(rows: int) -> None:
    inputs = {"costvolume": {"cost": volume(), "d": np.arange(6, dtype=np.int16)}}
    dims = {"costvolume": {"cost": ("y", "x", "d"), "d": ("d",)}}
    params = CostConfidenceParams()
    assert same(tiled(COST_CONFIDENCE, params, inputs, dims, rows), whole(COST_CONFIDENCE, params, inputs, dims))


def test_a_volume_must_have_three_dimensions() -> None:
    with pytest.raises(StageError, match="3 dimensions"):
        cost_confidence(np.zeros((2, 3)), 0, 5)
