from typing import Any

import numpy as np
import pytest
import zarr

from semidense.stages.disparity.aggregation import strips
from semidense.stages.disparity.aggregation.median import median
from semidense.stages.disparity.aggregation.stage import compute_aggregated, compute_right_aggregated
from semidense.stages.disparity.declaration import AGGREGATED, RIGHT_AGGREGATED, AggregatedParams
from semidense.stages.disparity.evidence import FEATURES
from semidense.stages.stage import Stage, StageError
from tests.stages.disparity.aggregation.direct import smoothed, sums
from tests.stages.disparity.aggregation.test_strips import pair
from tests.stages.tiling import same

Inputs = dict[str, dict[str, Any]]
WHOLE = AggregatedParams(p1=2, p2=7, subpixel=False, median=1)
both = pytest.mark.parametrize("stage", [AGGREGATED, RIGHT_AGGREGATED], ids=lambda stage: stage.product)


def inputs(shape: tuple[int, int, int] = (70, 9, 5), d_min: int = -1, seed: int = 0) -> Inputs:
    costs, gray = pair(shape, d_min, seed)
    return {
        "images": {"left": gray[..., None], "right": np.roll(gray, 1, axis=1)[..., None]},
        "costvolume": {"cost": costs, "d": np.arange(d_min, d_min + shape[2], dtype=np.int16)},
    }


@both
@pytest.mark.parametrize("d_min", [-3, 0])
def test_the_arrays_are_as_declared(stage: Stage, d_min: int) -> None:
    made = stage.function()(AggregatedParams(), inputs(d_min=d_min))
    assert {name: str(array.dtype) for name, array in made.items()} == {
        output.name: output.dtype for output in stage.outputs
    }
    assert made["disparity"].shape == (70, 9) and made["evidence"].shape == (len(FEATURES), 70, 9)
    assert np.array_equal(np.isnan(made["disparity"]), np.isnan(made["evidence"]).any(axis=0))


def test_the_winner_has_the_least_sum_of_the_cells_in_the_image() -> None:
    given = inputs((6, 8, 5), -2)
    costs = given["costvolume"]["cost"]
    total = sums(costs, smoothed(given["images"]["left"][..., 0]), -2, WHOLE)
    right = np.arange(8)[:, None] - np.arange(-2, 3)
    total[:, (right < 0) | (right >= 8)] = 1 << 20
    expected = np.where(np.isnan(costs).all(axis=2), np.nan, total.argmin(axis=2) - 2)
    assert np.array_equal(compute_aggregated(WHOLE, given)["disparity"], expected, equal_nan=True)


def test_the_right_view_is_the_left_one_of_the_mirrored_and_exchanged_pair() -> None:
    given = inputs((6, 8, 5), -2)
    costs = given["costvolume"]["cost"]
    mirrored = np.full_like(costs, np.nan)
    for x in range(8):
        for index, d in enumerate(range(-2, 3)):
            if 0 <= x + d < 8:
                mirrored[:, 7 - x, index] = costs[:, x + d, index]
    pair_ = {
        "images": {"left": given["images"]["right"][:, ::-1]},
        "costvolume": {**given["costvolume"], "cost": mirrored},
    }
    one, other = compute_right_aggregated(WHOLE, given), compute_aggregated(WHOLE, pair_)
    assert same(one, {name: array[..., ::-1] for name, array in other.items()})


@both
def test_however_it_is_cut_and_wherever_it_is_read_from(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    given = inputs()
    expected = stage.function()(AggregatedParams(), given)
    monkeypatch.setattr(strips, "CELLS", 1)
    given["costvolume"] = {name: zarr.array(array) for name, array in given["costvolume"].items()}
    assert same(stage.function()(AggregatedParams(), given), expected)


def test_subpixel_moves_a_disparity_by_at_most_half_a_pixel() -> None:
    whole, refined = (
        compute_aggregated(params, inputs())["disparity"] for params in (WHOLE, AggregatedParams(p1=2, p2=7, median=1))
    )
    moved = np.abs(whole - refined)
    assert np.nanmax(moved) <= 0.5 and np.nanmean(moved > 0) > 0.3


@both
def test_a_shifted_pair_is_found(stage: Stage) -> None:
    """Costs that are least where a pattern of 3 px of shift matches itself, but for a band that says nothing."""
    view = np.random.default_rng(0).integers(100, 103, (20, 30)).astype(np.uint8)
    costs = np.full((20, 30, 6), np.nan, np.float16)
    for d in range(6):
        costs[:, d:, d] = 0 if d == 3 else 8
    costs[5:10, 10:20] = np.where(np.isnan(costs[5:10, 10:20]), np.nan, 4)
    images = {"left": view[..., None], "right": np.roll(view, -3, axis=1)[..., None]}
    made = stage.function()(WHOLE, {"images": images, "costvolume": {"cost": costs, "d": np.arange(6, dtype=np.int16)}})
    seen = slice(3, None) if stage is AGGREGATED else slice(None, -3)
    assert (made["disparity"][:, seen] == 3).all()


def test_a_volume_that_does_not_fit_its_range_is_refused() -> None:
    given = inputs()
    given["costvolume"]["d"] = np.arange(3, dtype=np.int16)
    with pytest.raises(StageError, match="must agree"):
        compute_aggregated(WHOLE, given)


def test_a_larger_penalty_for_a_smaller_step_is_refused() -> None:
    with pytest.raises(ValueError, match="p2 8 must be at least p1 9"):
        AggregatedParams(p1=9, p2=8)


@both
@pytest.mark.parametrize("d_min", [-3, 0])
def test_the_median_is_that_of_the_map_and_stays_in_the_other_view(stage: Stage, d_min: int) -> None:
    alone, smooth = (
        stage.function()(AggregatedParams(p1=2, p2=7, median=side), inputs(d_min=d_min)) for side in (1, 3)
    )
    np.testing.assert_array_equal(smooth["evidence"], alone["evidence"])
    mirrored = slice(None, None, -1 if stage is RIGHT_AGGREGATED else 1)
    expected = median(np.ascontiguousarray(alone["disparity"][:, mirrored]), 3)
    np.testing.assert_array_equal(smooth["disparity"][:, mirrored], expected)
    met = np.arange(9) - expected
    assert np.nanmin(met) >= 0 and np.nanmax(met) <= 8
