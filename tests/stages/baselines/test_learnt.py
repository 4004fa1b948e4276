"""O1 and CCNN: a map whose right pixels lie on a plane and whose wrong ones are scattered must be told apart."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from semidense.stages.baselines.declaration import CCNN, CCNN_NET, O1, O1_FOREST, CcnnParams, ForestParams
from semidense.stages.baselines.learning import draw_pixels, labelled_scenes
from semidense.stages.baselines.o1 import forest_confidence, o1_features
from semidense.stages.metrics.confidence import auc
from semidense.stages.stage import NoParams, StageError
from tests.stages.tiling import same, tiled, whole

Products = dict[str, dict[str, NDArray[Any]]]


def scene(seed: int, size: tuple[int, int] = (48, 56)) -> Products:
    """Return a raw map and the truth: a slanted plane, half of it covered with random disparities."""
    rng = np.random.default_rng(seed)
    truth = np.add.outer(np.zeros(size[0]), np.arange(size[1]) // 8).astype(np.float32)
    raw = truth.copy()
    raw[: size[0] // 2] = rng.integers(0, 30, (size[0] // 2, size[1]))
    raw[0, 0], truth[1, 1] = np.nan, np.nan
    return {"disparity": {"disparity": raw}, "truth": {"disparity": truth}}


def split(*scenes: Products) -> dict[str, list[dict[str, NDArray[Any]]]]:
    return {product: [each[product] for each in scenes] for product in ("disparity", "truth")}


def judged(products: Products, confidence: NDArray[np.float32]) -> float:
    raw, truth = products["disparity"]["disparity"], products["truth"]["disparity"]
    known = np.isfinite(raw) & np.isfinite(truth)
    return auc(confidence[known], np.abs(raw - truth)[known] <= 1)


def test_features_by_hand() -> None:
    disparity = np.full((11, 11), 4, np.float32)
    disparity[5, 6] = 8
    found = o1_features(disparity, np.array([5, 5]), np.array([5, 6])).reshape(2, 4, 5)
    share = 24 / 25
    np.testing.assert_allclose(found[0, 0], [share, -np.log(2 / 25), 4, 0, 16 * share * (1 - share)], rtol=1e-5)
    np.testing.assert_allclose(found[1, 0, [0, 2, 3]], [1 / 25, 4, 4], rtol=1e-6)


def test_an_unknown_centre_has_no_features_and_unknown_neighbours_do_not_count() -> None:
    disparity = np.full((11, 11), 4, np.float32)
    disparity[5, 5:] = np.nan
    unknown, beside = o1_features(disparity, np.array([5, 5]), np.array([5, 4]))
    assert not unknown.any()
    assert beside[0] == 1, "all known neighbours agree"


def test_the_median_of_an_even_number_is_the_upper_middle_value() -> None:
    disparity = np.full((11, 11), np.nan, np.float32)
    disparity[5, 5:7] = 4, 8
    found = o1_features(disparity, np.array([5]), np.array([5])).reshape(4, 5)
    assert (found[:, 2:4] == [8, 4]).all()


def test_o1_learns_and_its_tiles_are_the_whole() -> None:
    pytest.importorskip("sklearn", reason="comes with the extra 'baselines'")
    forest = O1_FOREST.function()(ForestParams(samples=2000), split(scene(0), scene(1)))
    unseen = scene(2)
    inputs = {"disparity": unseen["disparity"], "o1_forest": forest}
    dims = {
        "disparity": {"disparity": ("y", "x")},
        "o1_forest": dict.fromkeys(forest, ("node",)),
    }
    found = whole(O1, NoParams(), inputs, dims)
    assert judged(unseen, found["confidence"]) < 0.2, "chance is 0.45"
    assert np.isnan(found["confidence"][0, 0]) and np.nanmax(found["confidence"]) <= 1
    assert same(found, tiled(O1, NoParams(), inputs, dims, 13))


def test_the_stored_forest_answers_as_scikit_learns_does() -> None:
    ensemble = pytest.importorskip("sklearn.ensemble", reason="comes with the extra 'baselines'")
    params, scenes = ForestParams(samples=800, trees=3, depth=6), split(scene(3))
    forest = O1_FOREST.function()(params, scenes)
    ((disparity, labels),) = labelled_scenes(scenes, 1.0)
    (places,) = draw_pixels([labels], 800, 0)
    features = o1_features(disparity, *places)
    reference = ensemble.RandomForestClassifier(3, max_depth=6, random_state=0).fit(features, labels[places])
    np.testing.assert_allclose(forest_confidence(forest, features), reference.predict_proba(features)[:, 1], rtol=1e-6)


def test_ccnn_learns_and_its_tiles_are_the_whole() -> None:
    net = CCNN_NET.function()(CcnnParams(steps=60, crop=32), split(scene(0), scene(1)))
    unseen = scene(2)
    inputs = {"disparity": unseen["disparity"], "ccnn_net": net}
    dims = {"disparity": {"disparity": ("y", "x")}, "ccnn_net": {"parameters": ("parameter",), "loss": ("step",)}}
    found = whole(CCNN, NoParams(), inputs, dims)
    assert judged(unseen, found["confidence"]) < 0.3, "chance is 0.45"
    np.testing.assert_allclose(tiled(CCNN, NoParams(), inputs, dims, 13)["confidence"], found["confidence"], atol=1e-6)


def test_the_same_seed_trains_the_same_ccnn() -> None:
    params, scenes = CcnnParams(steps=2, crop=16), split(scene(0))
    one, other = (CCNN_NET.function()(params, scenes) for _ in range(2))
    assert same(one, other)


def test_a_crop_may_be_larger_than_the_map() -> None:
    made = CCNN_NET.function()(CcnnParams(steps=1, crop=64), split(scene(0)))
    assert np.isfinite(made["parameters"]).all()


@pytest.mark.parametrize("stage", [O1_FOREST, CCNN_NET], ids=lambda stage: stage.product)
def test_without_a_labelled_pixel_nothing_is_learnt(stage: Any) -> None:  # noqa: ANN401
    if stage is O1_FOREST:
        pytest.importorskip("sklearn", reason="comes with the extra 'baselines'")
    empty = scene(0)
    empty["truth"]["disparity"][:] = np.nan
    with pytest.raises(StageError, match="known disparity"):
        stage.function()(stage.params(), split(empty))


def test_a_forest_needs_wrong_pixels_and_right_ones() -> None:
    pytest.importorskip("sklearn", reason="comes with the extra 'baselines'")
    perfect = scene(0)
    perfect["disparity"] = perfect["truth"]
    with pytest.raises(StageError, match="nothing to tell apart"):
        O1_FOREST.function()(ForestParams(samples=100), split(perfect))
