import numpy as np
import pytest

from semidense.stages.evaluation.evidence.foreign.confidence import weigh
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
from tests.stages.evaluation.evidence.foreign.products import products
from tests.stages.monitors import InterruptedTrainingError, Memory

PARAMS = ForeignNetParams(steps=60, batch=64, checkpoint_steps=20)


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


def test_every_kind_of_map_is_drawn_from() -> None:
    given = sampled()
    made = draw_foreign_samples(ForeignSamplesParams(pixels=40, precision="float32"), given)
    assert list(made) == [output.name for output in FOREIGN_SAMPLES.outputs]
    assert made["features"].dtype == made["error"].dtype == np.float32 and made["kind"].dtype == np.int8
    assert np.bincount(made["kind"]).max() <= 40 and np.isfinite(made["error"]).all()
    assert np.unique(made["kind"]).tolist() == list(range(len(KINDS)))
    again = draw_foreign_samples(ForeignSamplesParams(pixels=40, precision="float32"), given)
    assert all(np.array_equal(made[name], again[name]) for name in made)


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
    """Pixels that are right where the map agrees with itself, or, with a right view, where the cost is low."""
    scenes = []
    for number in range(count):
        rng = np.random.default_rng(number)
        known = rng.normal(size=(600, len(FEATURES))).astype(np.float32)
        right = known[:, FEATURES.index("cost")] < 0
        known[:, FEATURES.index("agreement 9")] += right
        error = np.where(right, 0.5, 4).astype(np.float32)
        scenes.append({"features": known, "error": error, "kind": np.zeros(600, np.int8)})
    return {"foreign_samples": scenes}


def test_one_net_learns_maps_with_and_without_a_right_view() -> None:
    given = training()
    made = train_foreign_net(PARAMS.model_copy(update={"steps": 300}), given)
    assert list(made) == [output.name for output in FOREIGN_NET.outputs]
    scene = given["foreign_samples"][0]
    right, seen = scene["error"] <= 1, scene["features"].T[:, np.newaxis].copy()
    with_right = np.mean((weigh(made["parameters"], seen)[0] > 0) == right)
    seen[-len(OF_CELLS) :] = 0
    without = np.mean((weigh(made["parameters"], seen)[0] > 0) == right)
    assert with_right > 0.95 and 0.6 < without < with_right


def test_a_training_that_was_killed_ends_as_an_undisturbed_one() -> None:
    memory = Memory(stop_after=50)
    with pytest.raises(InterruptedTrainingError):
        train_foreign_net(PARAMS, training(), memory)
    resumed = Memory(states=memory.states)
    again = train_foreign_net(PARAMS, training(), resumed)
    assert resumed.steps[0] == 41
    assert all(np.array_equal(again[name], array) for name, array in train_foreign_net(PARAMS, training()).items())
