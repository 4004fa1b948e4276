import numpy as np
import pytest

from semidense.stages.disparity.declaration import REFINED, RefinedParams
from semidense.stages.disparity.right_view import agreeing
from semidense.stages.disparity.winner_takes_all import refine_subpixel
from tests.stages.tiling import same, tiled, whole

N = np.float32(np.nan)
DIMS = {
    "semidense": {"disparity": ("y", "x")},
    "right_disparity": {"disparity": ("y", "x")},
    "costvolume": {"cost": ("y", "x", "d"), "d": ("d",)},
}


def inputs() -> dict[str, dict[str, np.ndarray]]:
    random = np.random.default_rng(0)
    disparity = random.integers(1, 4, (9, 12)).astype(np.float32)
    disparity[3, 4:6] = N
    return {
        "semidense": {"disparity": disparity},
        "right_disparity": {"disparity": random.integers(1, 4, (9, 12)).astype(np.float32)},
        "costvolume": {"cost": random.random((9, 12, 5)).astype(np.float16), "d": np.arange(5, dtype=np.int16)},
    }


def test_by_default_nothing_is_done_and_nothing_more_needed() -> None:
    given = inputs()
    made = REFINED.function()(RefinedParams(), {"semidense": given["semidense"]})
    assert np.array_equal(made["disparity"], given["semidense"]["disparity"], equal_nan=True)
    assert RefinedParams().inputs == ("semidense",)


@pytest.mark.parametrize(
    ("params", "needed"),
    [
        pytest.param(RefinedParams(left_right=True), {"semidense", "right_disparity"}, id="left-right"),
        pytest.param(RefinedParams(subpixel=True), {"semidense", "costvolume"}, id="subpixel"),
        pytest.param(RefinedParams(left_right=True, subpixel=True), set(REFINED.inputs), id="both"),
    ],
)
def test_each_step_does_its_own_and_the_same_in_tiles(params: RefinedParams, needed: set[str]) -> None:
    given = inputs()
    assert set(params.inputs) == needed
    expected = given["semidense"]["disparity"]
    if params.left_right:
        expected = agreeing(expected, given["right_disparity"]["disparity"])
    if params.subpixel:
        expected = refine_subpixel(given["costvolume"]["cost"], expected, 0)
    made = whole(REFINED, params, given, DIMS)
    assert np.array_equal(made["disparity"], expected, equal_nan=True)
    assert not np.array_equal(made["disparity"], given["semidense"]["disparity"], equal_nan=True)
    assert same(tiled(REFINED, params, given, DIMS, 4), made)


def test_what_was_refined_before_the_filter_stays() -> None:
    given = inputs()
    given["semidense"]["disparity"][:] = 2.25
    made = whole(REFINED, RefinedParams(subpixel=True), given, DIMS)
    assert (made["disparity"] == 2.25).all()
