import sys
from pathlib import Path

import pytest

from semidense.datasets import registry
from semidense.datasets.errors import DatasetError, SceneNotFound, UnknownDatasetError
from semidense.datasets.registry import Dataset, describe, open_dataset
from semidense.datasets.scene import DisparityRange, SceneSource


def source(name: str) -> SceneSource:
    return SceneSource(name, "any", "test", (1, 1), DisparityRange(0, 1), "any", files={})


ROOT = Dataset("any", tuple(source(name) for name in ("2003/Cones", "2003/Teddy", "2005/Books", "MiddEval3/Teddy")))


def names(dataset: Dataset) -> list[str]:
    return [scene.name for scene in dataset.scenes]


@pytest.mark.parametrize(
    "spec, hint",
    [
        pytest.param("midlebury:x", "did you mean middlebury:DIR?", id="a letter short"),
        pytest.param("Motorcycle", "did you mean motorcycle?", id="capital"),
        pytest.param("kitti:x", "did you mean kitti2015:DIR?", id="no year"),
        pytest.param("qqqqqqqqq", "known are motorcycle, middlebury:DIR", id="nothing near"),
        pytest.param("", "known are motorcycle", id="empty"),
    ],
)
def test_an_unknown_name_brings_the_nearest(spec: str, hint: str) -> None:
    with pytest.raises(UnknownDatasetError) as caught:
        open_dataset(spec)
    assert hint in str(caught.value)
    assert isinstance(caught.value, LookupError)


@pytest.mark.parametrize(
    ("code", "message"),
    [
        pytest.param("", "AttributeError: ", id="it lists nothing"),
        pytest.param("import nowhere_to_be_found", "ModuleNotFoundError: ", id="it cannot be imported"),
        pytest.param("def list_scenes(argument): return int(argument)", "ValueError: invalid literal", id="it fails"),
        pytest.param("def list_scenes(argument): return None", "TypeError: ", id="it gives no scenes"),
        pytest.param("def list_scenes(argument): return [3]", "listed 3; a scene is a SceneSource", id="no scene"),
    ],
)
def test_a_kind_of_another_package_that_fails_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, message: str
) -> None:
    (tmp_path / "rig_of_a_test.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "rig_of_a_test", raising=False)
    monkeypatch.setattr(registry, "_registered", {})
    registry.register_dataset(registry.Kind("rig:N", "a rig", "rig_of_a_test"))
    with pytest.raises(DatasetError, match=f"^data set rig:abc: rig_of_a_test .*{message}"):
        open_dataset("rig:abc")


@pytest.mark.parametrize("name", ["middlebury", "kitti2015", "eth3d"])
def test_a_folder_must_be_given_and_be_there(name: str, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=f"no folder given; write {name}:DIR"):
        open_dataset(name)
    with pytest.raises(FileNotFoundError, match="no such folder"):
        open_dataset(f"{name}:{tmp_path / 'absent'}")
    with pytest.raises(DatasetError, match=r"expected .*image_2|expected .*im0"):
        open_dataset(f"{name}:{tmp_path}")


@pytest.mark.parametrize(
    "wanted, found",
    [
        pytest.param(["2003/Cones"], ["2003/Cones"], id="full name"),
        pytest.param(["Cones"], ["2003/Cones"], id="end of a name that fits one"),
        pytest.param(["Books", "Cones", "Books"], ["2003/Cones", "2005/Books"], id="order of the data set, each once"),
        pytest.param([], [], id="none"),
    ],
)
def test_select_keeps_the_scenes_named(wanted: list[str], found: list[str]) -> None:
    assert names(ROOT.select(wanted)) == found
    assert ROOT.select(wanted).spec == ROOT.spec


@pytest.mark.parametrize(
    "name, hint",
    [
        pytest.param("Cone", "did you mean 2003/Cones?", id="a letter short"),
        pytest.param("2003/cones", "did you mean 2003/Cones", id="another case"),
        pytest.param("Teddy", "fits 2003/Teddy, MiddEval3/Teddy; give one of them", id="fits several"),
        pytest.param("ones", "no scene 'ones'; did you mean 2003/Cones?", id="the end of a word is no name"),
        pytest.param("zzz", "it has 2003/Cones, 2003/Teddy", id="nothing near"),
    ],
)
def test_select_names_the_nearest_scenes(name: str, hint: str) -> None:
    with pytest.raises(SceneNotFound) as caught:
        ROOT.select([name])
    assert hint in str(caught.value)
    assert "\n" not in str(caught.value)


def test_names_must_be_unique() -> None:
    with pytest.raises(DatasetError, match="several scenes are named one"):
        Dataset("any", (source("one"), source("two"), source("one")))


def test_describe_lists_what_open_dataset_takes() -> None:
    patterns = [pattern for pattern, _ in describe()]
    assert patterns == [
        *("motorcycle", "middlebury:DIR", "kitti2012:DIR", "kitti2015:DIR", "eth3d:DIR", "synthetic[:KEY=VALUE,...]"),
        *("pair:LEFT,RIGHT[,KEY=VALUE,...]", "map:PATTERN[,KEY=VALUE,...]@DATASET", "toml:FILE"),
    ]
    assert all(description for _, description in describe())


def test_data_sets_joined_by_a_plus_keep_their_scenes(tmp_path: Path) -> None:
    both = open_dataset("synthetic:train=1,test=0+motorcycle")
    apart = [scene for spec in ("synthetic:train=1,test=0", "motorcycle") for scene in open_dataset(spec).scenes]
    assert both.scenes == tuple(apart)
    assert both.spec == "synthetic:train=1,test=0+motorcycle"


def test_a_plus_in_the_name_of_a_folder_is_no_join(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"a\+b: no such folder"):
        open_dataset(f"eth3d:{tmp_path}/a+b")


def test_the_same_data_set_twice_is_refused() -> None:
    with pytest.raises(DatasetError, match="several scenes are named"):
        open_dataset("motorcycle+motorcycle")
