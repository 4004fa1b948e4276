from dataclasses import replace

import pytest

from semidense.datasets import open_dataset
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.training_split import assign_folds, outside, spread, with_folds

NAMES = ["2006/Art", "2006/Cloth1", "2006/Cloth2", "2006/Dolls", "2006/Wood1"]


@pytest.mark.parametrize(
    ("names", "folds", "expected"),
    [
        pytest.param(["a", "b", "c", "d"], 2, (0, 1, 0, 1), id="in turn"),
        pytest.param(NAMES, 2, (0, 1, 1, 0, 0), id="siblings together, the smaller fold next"),
        pytest.param(NAMES, 3, (0, 1, 1, 2, 0), id="three"),
        pytest.param(["train-0", "train-1"], 2, (0, 1), id="all siblings: each its own way"),
        pytest.param(["a1", "a2", "b"], 2, (0, 0, 1), id="two families"),
    ],
)
def test_folds_are_assigned(names: list[str], folds: int, expected: tuple[int, ...]) -> None:
    assert assign_folds(names, folds) == expected


def test_fewer_scenes_than_folds_are_refused() -> None:
    with pytest.raises(UsageError, match="3 folds take 3 scenes at least, one each, and there are 2"):
        assign_folds(["a", "b"], 3)


def test_a_network_sees_the_other_folds_only() -> None:
    folds = assign_folds(NAMES, 2)
    for fold in (0, 1):
        seen = outside(NAMES, folds, fold)
        assert {folds[NAMES.index(name)] for name in seen} == {1 - fold}


def test_maps_are_of_at_most_so_many_scenes_of_each_data_set() -> None:
    scenes = open_dataset("synthetic:train=7,test=2").scenes
    both = (*scenes, *(replace(scene, dataset="other") for scene in scenes[:2]))
    chosen = [(scene.name, scene.dataset) for scene in spread(both, 3)]
    assert chosen == [(both[at].name, both[at].dataset) for at in (2, 5, 8, 9, 10)]
    assert spread(both, None) == spread(both, 100) == both


def test_the_configuration_gets_the_folds() -> None:
    config = with_folds(Config.load(settings=['training.shipped=["matching_net"]']), NAMES)
    assert config.calibration.fold_of_scene == (0, 1, 1, 0, 0)
    assert not config.training.shipped, "what comes with the package has seen the scenes"


@pytest.mark.parametrize("net", ["matching_net", "descriptor_net", "evaluation_net"])
@pytest.mark.parametrize(("folds", "steps"), [(2, 1000), (4, 1500)])
def test_a_network_of_a_fold_sees_a_scene_as_often_as_one_of_all(net: str, folds: int, steps: int) -> None:
    config = Config.load(settings=[f"calibration.folds={folds}", f"{net}.steps=2000"])
    assert getattr(with_folds(config, NAMES), net).steps == steps


@pytest.mark.parametrize(
    "given",
    [
        pytest.param("[0,1]", id="too few"),
        pytest.param("[0,0,0,0,0]", id="one fold"),
    ],
)
def test_given_folds_must_fit(given: str) -> None:
    with pytest.raises(UsageError, match="there are 5 training scenes, and it takes two folds at least"):
        with_folds(Config.load(settings=[f"calibration.fold_of_scene={given}"]), NAMES)
    fitting = Config.load(settings=["calibration.fold_of_scene=[1,0,0,0,0]"])
    assert with_folds(fitting, NAMES).calibration.fold_of_scene == (1, 0, 0, 0, 0)
