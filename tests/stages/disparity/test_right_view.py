import numpy as np
import pytest

from semidense.stages.disparity.declaration import RIGHT_DISPARITY
from semidense.stages.disparity.right_view import agreeing, right_costs
from semidense.stages.disparity.winner_takes_all import winner_take_all
from semidense.stages.stage import NoParams, StageError
from tests.stages.left_right import CASES
from tests.stages.tiling import same, tiled, whole

N = np.nan


@pytest.mark.parametrize("d_min", [-2, 0, 3, 40])
def test_a_cell_is_the_same_seen_from_the_right(d_min: int) -> None:
    costs = np.random.default_rng(0).normal(size=(3, 7, 4)).astype(np.float16)
    right = right_costs(costs, d_min)
    assert right.dtype == np.float16
    for y, x, k in np.ndindex(right.shape):
        column = x + d_min + k
        expected = costs[y, column, k] if 0 <= column < 7 else N
        assert np.array_equal(right[y, x, k], expected, equal_nan=True)


def test_twice_seen_is_the_volume_again_where_both_views_see() -> None:
    costs = np.random.default_rng(0).normal(size=(3, 9, 4)).astype(np.float32)
    mirrored = right_costs(costs, 1)[:, ::-1]
    again = right_costs(mirrored, 1)[:, ::-1]
    both = ~np.isnan(again)
    assert both.any()
    assert np.array_equal(again[both], costs[both])


@pytest.mark.parametrize(("left", "right", "confirmed"), CASES)
def test_by_hand(left: list[float], right: list[float], confirmed: list[bool]) -> None:
    kept = np.where(confirmed, np.float32(left), np.float32(N))
    assert np.array_equal(agreeing(np.float32([left]), np.float32([right])), [kept], equal_nan=True)


def test_a_smaller_tolerance_keeps_less() -> None:
    found = agreeing(np.float32([[0, 1, 1]]), np.float32([[1, 0, 0]]), 0.5)
    assert np.array_equal(found, np.float32([[N, 1, N]]), equal_nan=True)


def test_maps_of_different_shapes_are_refused() -> None:
    with pytest.raises(StageError, match="must be equal"):
        agreeing(np.zeros((1, 2), np.float32), np.zeros((2, 1), np.float32))


def test_the_stage_is_the_same_in_tiles_and_takes_the_least_cost() -> None:
    costs = np.random.default_rng(0).normal(size=(10, 8, 3)).astype(np.float16)
    inputs = {"costvolume": {"cost": costs, "d": np.arange(2, 5, dtype=np.int16)}}
    dims = {"costvolume": {"cost": ("y", "x", "d"), "d": ("d",)}}
    made = whole(RIGHT_DISPARITY, NoParams(), inputs, dims)
    assert same(tiled(RIGHT_DISPARITY, NoParams(), inputs, dims, 3), made)
    assert np.array_equal(made["disparity"], winner_take_all(right_costs(costs, 2), 2), equal_nan=True)
