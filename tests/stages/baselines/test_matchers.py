"""All matchers alike: they find a plane, say nothing where nothing can be said, and keep to their declarations."""

from importlib import resources
from typing import Any

import numpy as np
import pytest
import torch

from semidense.stages.baselines.declaration import (
    BASELINES,
    CENSUS,
    MATCHED,
    MC_CNN,
    MC_CNN_ACCURATE,
    SGM,
    SNCC,
    CheckedParams,
    SgmParams,
    WindowParams,
)
from semidense.stages.stage import Stage, StageError
from semidense.stages.transforms.gray import gray_moments
from tests.stages.baselines.pairs import SHIFT, shifted_pair
from tests.stages.tiling import same, tiled, whole

MODULES = {"sgm": "cv2", "mc_cnn": "mc_cnn", "mc_cnn_accurate": "mc_cnn"}
DIMS = {"images": {"left": ("y", "x", "band"), "right": ("y", "x", "band"), "moments": ("view", "moment")}}
matchers = pytest.mark.parametrize(
    "stage", (SGM, CENSUS, SNCC, MC_CNN, MC_CNN_ACCURATE), ids=lambda stage: stage.product
)
window_matchers = pytest.mark.parametrize("stage", (CENSUS, SNCC), ids=lambda stage: stage.product)


def matched(stage: Stage, images: dict[str, Any], **settings: object) -> Any:  # noqa: ANN401
    if stage.product in MODULES:
        pytest.importorskip(MODULES[stage.product], reason="comes with the extra 'baselines'")
    return stage.function()(stage.params(d_min=0, d_max=8, **settings), {"images": images})


@matchers
def test_a_textured_plane_is_found_in_every_pixel_that_both_views_show(stage: Stage) -> None:
    found = matched(stage, shifted_pair())
    assert set(found) == {"dense", "disparity"}
    inner = np.s_[8:-8, 16:-8]  # SGBM leaves the left border out
    for name in found:
        assert found[name].shape == (40, 64) and found[name].dtype == np.float32
        # MC-CNN accurate's weights answer a pixel high now and then, even here.
        np.testing.assert_allclose(found[name][inner], SHIFT, atol=1.0 if stage is MC_CNN_ACCURATE else 0.3)


@window_matchers
def test_where_the_right_view_ends_no_disparity_leaves_it(stage: Stage) -> None:
    dense = matched(stage, shifted_pair())["dense"]
    assert (dense[:, 0] == 0).all(), "only disparity 0 has a right pixel"
    assert (dense <= np.arange(64)).all()


@window_matchers
def test_a_negative_range_is_searched_too(stage: Stage) -> None:
    images = shifted_pair()
    turned = {"left": images["right"], "right": images["left"]}
    found = stage.function()(WindowParams(d_min=-8, d_max=0), {"images": turned})
    np.testing.assert_array_equal(found["disparity"][8:-8, 8:-16], -SHIFT)


@window_matchers
def test_a_flat_pair_gives_the_smallest_disparity(stage: Stage) -> None:
    flat = {view: np.full((20, 24, 1), 90, np.uint8) for view in ("left", "right")}
    assert (matched(stage, flat)["dense"] == 0).all()


@window_matchers
@pytest.mark.parametrize("rows", [7, 16, 40], ids=lambda rows: f"tiles of {rows} rows")
def test_tiles_give_what_the_whole_image_gives(stage: Stage, rows: int) -> None:
    params, inputs = WindowParams(d_min=0, d_max=8), {"images": shifted_pair(seed=2)}
    noisy = inputs["images"]["right"]
    noisy[:] = noisy // 2 + np.random.default_rng(1).integers(0, 90, noisy.shape, dtype=np.uint8)
    assert same(tiled(stage, params, inputs, DIMS, rows), whole(stage, params, inputs, DIMS))


def test_sgm_says_nothing_where_the_search_would_leave_the_right_view() -> None:
    found = matched(SGM, shifted_pair())
    assert np.isnan(found["disparity"][:, 0]).all()
    assert np.isfinite(found["dense"]).mean() > 0.99, "the dense map is asked everywhere"


def test_mc_cnn_accurate_answers_as_its_package_does() -> None:
    model = pytest.importorskip("mc_cnn.model.mc_cnn_accurate", reason="comes with the extra 'baselines'")
    images = shifted_pair(20, 32, seed=4)
    images["right"] = images["right"] // 2 + 30
    images["moments"] = np.array([gray_moments(images[view][..., 0]) for view in ("left", "right")])
    net = model.AccMcCnnInfer()
    weights = resources.files("mc_cnn") / "weights" / "mc_cnn_accurate_mb_weights.pt"
    net.load_state_dict(torch.load(str(weights), "cpu", weights_only=True)["model"])
    views = (np.pad(images[view][..., 0].astype(np.float32), 5, mode="edge") for view in ("left", "right"))
    scaled = [torch.from_numpy((view - m) / s) for view, (m, s) in zip(views, images["moments"], strict=True)]
    volume = net(*(view.float() for view in scaled), -8, 0)[..., ::-1]  # the package's disparity has the other sign
    dense = matched(MC_CNN_ACCURATE, images)["dense"].astype(int)
    best = np.take_along_axis(volume, dense[..., None], 2)[..., 0]
    np.testing.assert_allclose(best, np.nanmin(volume, 2), atol=1e-5)
    assert len(np.unique(dense)) > 3


def test_tiles_of_mc_cnn_accurate_give_what_the_whole_image_gives() -> None:
    pytest.importorskip("mc_cnn", reason="comes with the extra 'baselines'")
    params, inputs = CheckedParams(d_min=0, d_max=4), {"images": shifted_pair(24, 32, seed=2)}
    assert same(tiled(MC_CNN_ACCURATE, params, inputs, DIMS, 8), whole(MC_CNN_ACCURATE, params, inputs, DIMS))


@matchers
def test_a_range_is_needed(stage: Stage) -> None:
    if stage.product in MODULES:
        pytest.importorskip(MODULES[stage.product], reason="comes with the extra 'baselines'")
    with pytest.raises(StageError, match="disparity range"):
        stage.function()(stage.params(), {"images": shifted_pair()})


@pytest.mark.parametrize(
    ("stage", "settings", "message"),
    [
        pytest.param(CENSUS, {"window": 4}, "no centre", id="an even window"),
        pytest.param(SGM, {"p1": 9, "p2": 9}, "above p1", id="penalties that do not rise"),
        pytest.param(SGM, {"tolerance": 0}, "greater than or equal to 1", id="a tolerance that OpenCV takes for 1"),
        pytest.param(SNCC, {"d_min": 3, "d_max": 2}, "below d_min", id="a range the wrong way round"),
    ],
)
def test_settings_that_make_no_sense_are_refused(stage: Stage, settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        stage.params(**settings)


def test_only_what_comes_with_the_extra_is_needed() -> None:
    extra = {"opencv-python-headless", "mccnn", "scikit-learn"}
    assert {name for stage in (*MATCHED, *BASELINES) for name in stage.needs} == extra
    assert SgmParams().p2 > SgmParams().p1


@pytest.mark.parametrize("checked", [False, True])
def test_sgm_finds_nothing_beyond_its_range(checked: bool) -> None:
    """OpenCV searches whole sixteens: a true move of 8 px lies in its range, and not in one of 0 to 4 px."""
    pytest.importorskip("cv2")
    from semidense.stages.baselines.declaration import SgmParams
    from semidense.stages.baselines.sgm import match_semi_global

    right = np.random.default_rng(0).integers(0, 255, (40, 60), np.uint8)
    left = np.roll(right, 8, axis=1)
    found = match_semi_global(left, right, SgmParams(d_min=0, d_max=4), checked=checked)
    assert np.nanmax(found, initial=0) <= 4
    assert np.isnan(found[:, 16:]).any() == checked


def occluded_pair() -> tuple[np.ndarray[Any, np.dtype[np.uint8]], ...]:
    """Return two noisy views of a square that stands 9 px before its ground."""
    rng = np.random.default_rng(0)
    ground, square = (rng.integers(0, 256, shape, np.uint8) for shape in ((48, 90), (24, 30)))
    left, right = ground[:, 2:].copy(), ground[:, :-2].copy()
    left[12:36, 40:70], right[12:36, 29:59] = square, square
    return tuple(np.clip(view + rng.normal(0, 9, view.shape), 0, 255).astype(np.uint8) for view in (left, right))


def test_the_dense_map_of_sgm_has_a_disparity_everywhere() -> None:
    pytest.importorskip("cv2")
    from semidense.stages.baselines.sgm import match_semi_global

    dense, checked = (
        match_semi_global(*occluded_pair(), SgmParams(d_min=0, d_max=15), checked=c) for c in (False, True)
    )
    assert np.isfinite(dense).all()
    assert np.isnan(checked[:, 16:]).any(), "the pair has pixels that fail the left-right check"


@pytest.mark.parametrize(
    ("width", "settings", "answered"),
    [
        pytest.param(17, {"d_min": 0, "d_max": 8}, False, id="sixteen disparities and half the block"),
        pytest.param(18, {"d_min": 0, "d_max": 8}, True, id="one column more"),
        pytest.param(37, {"d_min": 0, "d_max": 16, "window": 11}, False, id="17 disparities are searched as 32"),
        pytest.param(9, {"d_min": -8, "d_max": 0}, False, id="a negative range"),
    ],
)
def test_sgm_says_nothing_of_an_image_too_narrow_for_its_range(
    width: int, settings: dict[str, int], answered: bool
) -> None:
    pytest.importorskip("cv2")
    from semidense.stages.baselines.sgm import match_semi_global

    view = np.random.default_rng(0).integers(0, 256, (40, width), np.uint8)
    params = SgmParams(uniqueness=0, speckle=0, **settings)
    checked = match_semi_global(view, view, params, checked=True)
    assert checked.shape == view.shape and checked.dtype == np.float32
    assert np.isfinite(checked).any() == answered
    assert np.isfinite(match_semi_global(view, view, params, checked=False)).all()
