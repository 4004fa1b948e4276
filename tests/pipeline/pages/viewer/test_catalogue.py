from pathlib import Path

import numpy as np
import pytest

from semidense.cache import Store
from semidense.pipeline.pages.viewer.catalogue import catalogue
from semidense.pipeline.results.result import Result
from tests.handmade import Handmade, handmade, judge


@pytest.fixture
def made(tmp_path: Path) -> Handmade:
    return handmade(tmp_path / "cache")


def test_everything_behind_a_confidence_is_found(made: Handmade) -> None:
    (scene,) = catalogue(made.store)
    assert (scene.dataset, scene.name) == ("handmade", "Hand")
    (configuration,) = scene.configurations
    assert set(configuration.entries) == {"images", "channels", "costvolume", "disparity", "confidence", "truth"}
    assert configuration.keys["truth"] == made.entries["truth"].key


def test_what_was_made_from_a_configuration_is_found(made: Handmade) -> None:
    first = made.entries["confidence"]
    disparity = np.zeros((60, 90), np.float32)
    made.write("semidense", {"R": 0.9}, ("disparity", "confidence"), disparity=disparity)
    made.write("filled", {}, ("disparity", "semidense"), disparity=disparity)
    made.write("sgm", {}, ("images",), disparity=disparity)
    judge(made, np.zeros((60, 90), np.float32), 7)
    made.write("semidense", {"R": 0.8}, ("disparity", "confidence"), disparity=disparity + 1)
    configurations = catalogue(made.store)[0].configurations
    further = {each.keys["confidence"]: [entry.recipe.stage for entry in each.further] for each in configurations}
    assert further == {
        first.key: ["metrics", "semidense", "filled", "sgm"],
        made.entries["confidence"].key: ["sgm", "metrics", "semidense"],
    }


def test_configurations_are_named_by_what_differs(made: Handmade) -> None:
    judge(made, np.zeros((60, 90), np.float32), 7)
    (scene,) = catalogue(made.store)
    names = [each.name.split(" - ")[0] for each in scene.configurations]
    assert names == ["paper, exact, confidence.variant=7", "paper, exact, confidence.variant=0"]
    assert len({each.name for each in scene.configurations}) == 2


def test_a_disparity_without_confidence_is_one_too(made: Handmade) -> None:
    made.write("disparity", {"subpixel": True}, ("costvolume",), disparity=np.ones((60, 90), np.float32))
    (scene,) = catalogue(made.store)
    assert "no confidence" in scene.configurations[0].name
    assert "truth" in scene.configurations[0].entries, "the truth belongs to the images"


def test_pairs_of_one_name_are_two_scenes(made: Handmade) -> None:
    made.write("images", {"other": 1}, (), left=np.zeros((60, 90, 3), np.uint8))
    made.write("channels", {"use": ["gray"]}, ("images",), channels=np.zeros((2, 1, 60, 90), np.float32))
    made.write("costvolume", {}, ("channels",), cost=np.zeros((60, 90, 2), np.float16), d=np.arange(2, dtype=np.int16))
    made.write("disparity", {}, ("costvolume",), disparity=np.zeros((60, 90), np.float32))
    scenes = catalogue(made.store)
    assert len({scene.name for scene in scenes}) == 2
    known = sorted("truth" in scene.configurations[0].entries for scene in scenes)
    assert known == [False, True], "one pair's truth is not the other's"


def test_what_a_real_run_left_is_found(trained: Result) -> None:
    scenes = {scene.name: scene for scene in catalogue(trained.store)}
    assert set(scenes) == {"test-0", "train-0", "train-1"}
    keys = scenes["test-0"].configurations[0].keys
    for product in ("images", "truth", "channels", "costvolume", "disparity", "confidence"):
        assert keys[product] == trained.find(product, "test-0").key
    assert "truth" in scenes["train-0"].configurations[0].entries, "known from the samples"


def test_an_empty_cache_has_no_scene(tmp_path: Path) -> None:
    assert catalogue(Store(tmp_path)) == ()
