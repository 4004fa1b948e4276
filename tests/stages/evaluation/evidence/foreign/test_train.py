import numpy as np
import pytest

from semidense.stages.evaluation.evidence.confidence import weigh
from semidense.stages.evaluation.evidence.declaration import REACH
from semidense.stages.evaluation.evidence.foreign.declaration import (
    FEATURES,
    FOREIGN_NET,
    FOREIGN_SAMPLES,
    KINDS,
    OF_CELLS,
    ForeignNetParams,
    ForeignSamplesParams,
)
from semidense.stages.evaluation.evidence.foreign.kinds import kinds_of
from semidense.stages.evaluation.evidence.foreign.samples import draw_foreign_samples
from semidense.stages.evaluation.evidence.foreign.train import train_foreign_net
from semidense.stages.stage import StageError
from tests.stages.evaluation.evidence.foreign.products import products
from tests.stages.monitors import InterruptedTrainingError, Memory

PARAMS = ForeignNetParams(steps=60, batch=2, checkpoint_steps=20)
SAMPLES = ForeignSamplesParams(crops=3, height=10, width=12, precision="float32")


def sampled() -> dict[str, dict[str, np.ndarray]]:
    """A scene whose maps of all matchers are the same, with holes where they are checked."""
    given = products(height=24, width=30)
    disparity = given["disparity"]["disparity"]
    checked = np.where(np.arange(30) < 20, disparity, np.float32(np.nan))
    made = {"dense": disparity, "disparity": checked}
    truth = np.full((24, 30), 3, np.float32)
    truth[:2] = np.nan
    return {
        **given,
        **dict.fromkeys(("sgm", "sncc", "census", "mc_cnn"), made),
        "aggregated": {"disparity": disparity},
        "truth": {"disparity": truth},
    }


def test_crops_of_every_kind_of_map_are_drawn() -> None:
    given = sampled()
    made = draw_foreign_samples(SAMPLES, given)
    assert {name: (array.shape, str(array.dtype)) for name, array in made.items()} == {
        "features": ((3 * len(KINDS), len(FEATURES), 10 + 2 * REACH, 12), "float16"),
        "error": ((3 * len(KINDS), 10, 12), "float32"),
        "kind": ((3 * len(KINDS),), "int8"),
    }
    assert list(made) == [output.name for output in FOREIGN_SAMPLES.outputs]
    assert made["kind"].tolist() == np.repeat(np.arange(len(KINDS)), 3).tolist()
    assert np.isfinite(made["error"]).any(axis=(1, 2)).all()
    again = draw_foreign_samples(SAMPLES, given)
    assert all(np.array_equal(made[name], again[name], equal_nan=True) for name in made)


def test_a_crop_is_no_larger_than_its_scene_and_shows_what_lies_around_it() -> None:
    made = draw_foreign_samples(SAMPLES.model_copy(update={"height": 96, "width": 96}), sampled())
    assert made["error"].shape[1:] == (24, 30)
    assert np.isnan(made["error"][:, :2]).all()  # no truth
    checked = made["kind"] == KINDS.index("sgm, checked")
    assert np.isnan(made["error"][checked][..., 20:]).all()  # no disparity
    own = made["features"][~checked, FEATURES.index("known 9")]
    assert own.shape[1:] == (24 + 2 * REACH, 30) and np.isfinite(own).all()


def test_a_scene_without_a_truth_is_refused() -> None:
    given = sampled()
    given["truth"]["disparity"][:] = np.nan
    with pytest.raises(StageError, match="sgm, dense: no pixel has both a disparity and a truth"):
        draw_foreign_samples(SAMPLES, given)


def test_kinds_have_the_holes_and_steps_that_they_are_called_by() -> None:
    kinds = dict(kinds_of(sampled()))
    assert np.isnan(kinds["sgm, checked"][:, 25]).all()
    assert np.isfinite(kinds["sgm, checked and filled"]).all()
    whole = kinds["summed costs, whole disparities"]
    assert np.array_equal(whole, np.rint(whole), equal_nan=True)
    roughness = {name: np.nanmean(np.abs(np.diff(kinds[name], axis=1))) for name in kinds}
    assert roughness["summed costs, blurred"] < roughness["summed costs"]
    assert roughness["summed costs, smoothed"] < roughness["summed costs"]


def training(count: int = 2) -> dict[str, object]:
    """Crops that are right where the map agrees with itself, or, with a right view, where the cost is low."""
    scenes = []
    for number in range(count):
        rng = np.random.default_rng(number)
        known = rng.normal(size=(3, len(FEATURES), 16 + 2 * REACH, 20)).astype(np.float32)
        right = known[:, FEATURES.index("cost")] < 0
        known[:, FEATURES.index("agreement 9")] += right
        error = np.where(right, np.float32(0.5), np.float32(4))[:, REACH:-REACH]
        error[:, 0] = np.nan
        scenes.append({"features": known.astype(np.float16), "error": error, "kind": np.zeros(3, np.int8)})
    return {"foreign_samples": scenes}


def test_one_net_learns_maps_with_and_without_a_right_view() -> None:
    given = training()
    made = train_foreign_net(PARAMS.model_copy(update={"steps": 400}), given)
    assert list(made) == [output.name for output in FOREIGN_NET.outputs]
    scene = given["foreign_samples"][0]
    right, seen = scene["error"][0, 1:] <= 1, scene["features"][0].astype(np.float32)
    with_right = np.mean((weigh(made["parameters"], seen)[1:] > 0) == right)
    seen[-len(OF_CELLS) :] = 0
    without = np.mean((weigh(made["parameters"], seen)[1:] > 0) == right)
    assert with_right > 0.9 and 0.6 < without < with_right


def test_a_training_that_was_killed_ends_as_an_undisturbed_one() -> None:
    memory = Memory(stop_after=50)
    with pytest.raises(InterruptedTrainingError):
        train_foreign_net(PARAMS, training(), memory)
    resumed = Memory(states=memory.states)
    again = train_foreign_net(PARAMS, training(), resumed)
    assert resumed.steps[0] == 41
    assert all(np.array_equal(again[name], array) for name, array in train_foreign_net(PARAMS, training()).items())
