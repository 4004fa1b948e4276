"""Scenes with the maps of another matcher."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semidense.datasets import DatasetError, DisparityRange, open_dataset
from semidense.datasets.pairs.arrays import array_pair
from semidense.datasets.pairs.options import PairOptions

SHAPE = (30, 40)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two pairs, a and b, and a map of a."""
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        for name in "ab":
            view = np.random.default_rng(ord(name)).integers(0, 256, SHAPE, np.uint8)
            Image.fromarray(view).save(tmp_path / side / f"{name}.png")
    np.save(tmp_path / "a.npy", np.full(SHAPE, 4.5, np.float32))
    return tmp_path


def pairs(folder: Path) -> str:
    return f"pair:{folder}/left,{folder}/right"


def test_each_scene_that_has_a_map_comes_with_it(folder: Path) -> None:
    (scene,) = open_dataset(f"map:{folder}/*.npy@{pairs(folder)}").scenes
    assert scene.name == "a" and scene.has("disparity") and not scene.one_view
    assert scene.disparities == DisparityRange(4, 5) and scene.open_ends == ()
    assert np.unique(scene.load_map()).tolist() == [4.5]
    assert scene.image_identity() == open_dataset(pairs(folder)).scenes[0].image_identity(), "the views are the same"


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        pytest.param("map:{0}/*.npy", "write map:PATTERN", id="no dataset"),
        pytest.param("map:{0}/a.npy@{1}", r"with one \*", id="no star"),
        pytest.param("map:{0}/*.pfm@{1}", "no scene has a map; the first would be .*a.pfm", id="no map"),
        pytest.param("map:{0}/*.npy,d_min=3@{1}", "write PATTERN", id="another option"),
        pytest.param("map:{0}/*.npy,scale=x@{1}", "scale=x; expected a number", id="no number"),
    ],
)
def test_what_cannot_be_understood_is_refused(spec: str, message: str, folder: Path) -> None:
    with pytest.raises(DatasetError, match=message):
        open_dataset(spec.format(folder, pairs(folder)))


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        pytest.param((40, 30), "rows and columns are exchanged", id="transposed"),
        pytest.param((15, 20), "enlarge the map by 2 ", id="half the size"),
        pytest.param((30, 41), "give the map of this view", id="another size"),
    ],
)
def test_a_map_of_another_size_is_refused(shape: tuple[int, int], message: str, folder: Path) -> None:
    np.save(folder / "a.npy", np.full(shape, 4.5, np.float32))
    with pytest.raises(DatasetError, match=message):
        open_dataset(f"map:{folder}/*.npy@{pairs(folder)}")


def test_a_left_view_alone_has_no_right_one(folder: Path) -> None:
    (scene,) = open_dataset(f"pair:{folder}/left/a.png,disparity={folder}/a.npy").scenes
    assert scene.one_view and "right" not in scene.files
    left, right = scene.load_images()
    assert left.any() and not right.any()


def test_a_map_belongs_to_one_pair(folder: Path) -> None:
    with pytest.raises(DatasetError, match="belongs to one pair, but there are 2"):
        open_dataset(f"{pairs(folder)},disparity={folder}/a.npy")


def test_how_it_is_read_and_its_bytes_are_in_its_identity(folder: Path) -> None:
    np.save(folder / "a.npy", np.full(SHAPE, 72, np.int16))
    known = [
        open_dataset(f"pair:{folder}/left/a.png,disparity={folder}/a.npy{more}").scenes[0]
        for more in ("", ",scale=16", ",scale=8")
    ]
    assert known[0].map_reading == known[1].map_reading != known[2].map_reading, "16 was recognised"
    assert np.unique(known[2].load_map()).tolist() == [9.0]


def test_arrays_are_read_as_files_are(folder: Path) -> None:
    left = np.zeros(SHAPE, np.uint8)
    (scene,) = array_pair(left, None, PairOptions(), disparity=np.full(SHAPE, 72, np.int16)).scenes
    assert scene.one_view and scene.has("disparity") and np.unique(scene.load_map()).tolist() == [4.5]
    other = array_pair(left, None, PairOptions(), disparity=np.full(SHAPE, 73, np.int16)).scenes[0]
    assert scene.identity(("disparity",)) != other.identity(("disparity",))
    with pytest.raises(DatasetError, match="the disparity map: 40 x 30 pixels"):
        array_pair(left, None, PairOptions(), disparity=np.full((40, 30), 5.0))
