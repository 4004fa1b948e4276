import json
import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError, replace
from pathlib import Path

import numpy as np
import pytest

from semidense.datasets.errors import DatasetError, MissingFileError
from semidense.datasets.formats.png16 import write_png16
from semidense.datasets.scene import Calibration, DisparityRange, Scene, SceneSource, Truth

GRAY = np.zeros((2, 3), np.uint8)
RANGE = DisparityRange(0, 3)
UNKNOWN_CORNER = np.array([[np.nan, 1, 1], [1, 1, 1]], np.float32)
KNOWN = ~np.isnan(UNKNOWN_CORNER)


def truth(**changes: object) -> Truth:
    return Truth(**({"disparity": UNKNOWN_CORNER, "nonocc": KNOWN, "mask": "published"} | changes))


@pytest.mark.parametrize(
    "minimum, maximum, count",
    [
        pytest.param(0, 69, 70, id="both ends count"),
        pytest.param(-5, 5, 11, id="negative disparities"),
        pytest.param(4, 4, 1, id="one disparity"),
    ],
)
def test_range_counts_both_ends(minimum: int, maximum: int, count: int) -> None:
    assert DisparityRange(minimum, maximum).count == count


def test_range_refuses_a_maximum_below_the_minimum() -> None:
    with pytest.raises(DatasetError, match=r"\[1, 0\] is empty"):
        DisparityRange(1, 0)


@pytest.mark.parametrize(
    "focal, baseline, doffs",
    [
        pytest.param(0, 1, 0, id="no focal length"),
        pytest.param(1, -1, 0, id="negative baseline"),
        pytest.param(float("nan"), 1, 0, id="focal length NaN"),
        pytest.param(1, 1, float("inf"), id="infinite doffs"),
    ],
)
def test_calibration_refuses_what_gives_no_depth(focal: float, baseline: float, doffs: float) -> None:
    with pytest.raises(DatasetError, match="calibration"):
        Calibration(focal, baseline, doffs)


@pytest.mark.parametrize(
    "changes, message",
    [
        pytest.param({"disparity": UNKNOWN_CORNER.astype(float)}, "float64", id="float64"),
        pytest.param({"disparity": np.zeros((2, 3, 1), np.float32)}, "2 x 3 x 1", id="three dimensions"),
        pytest.param({"disparity": np.zeros((0, 3), np.float32)}, "not empty", id="empty"),
        pytest.param({"disparity": np.full((2, 3), np.inf, np.float32)}, "NaN", id="unknown as infinity"),
        pytest.param({"nonocc": KNOWN[:1]}, "1 x 3", id="mask of another size"),
        pytest.param({"nonocc": KNOWN.astype(np.uint8)}, "uint8", id="mask of numbers"),
        pytest.param({"nonocc": np.ones((2, 3), bool)}, "unknown", id="mask over unknown truth"),
        pytest.param({"right": np.zeros((2, 2), np.float32)}, "right truth is 2 x 2", id="right of another size"),
        pytest.param({"right": np.zeros((2, 3), int)}, "right truth is int64", id="right of integers"),
    ],
)
def test_truth_refuses_what_does_not_fit(changes: dict[str, object], message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        truth(**changes)


@pytest.mark.parametrize(
    "left, right, message",
    [
        pytest.param(GRAY, GRAY[:1], "both views must agree", id="sizes differ"),
        pytest.param(GRAY, np.dstack([GRAY] * 3), "both views must agree", id="gray and colour"),
        pytest.param(GRAY, GRAY.astype(np.uint16), "both views must agree", id="8 and 16 bits"),
        pytest.param(GRAY.astype(float), GRAY, "left image is float64", id="float image"),
        pytest.param(GRAY, GRAY[0], "right image is uint8, 3;", id="one dimension"),
        pytest.param(np.dstack([GRAY] * 4), GRAY, "left image is uint8, 2 x 3 x 4", id="alpha"),
        pytest.param(GRAY[:0], GRAY[:0], "left image is empty", id="empty"),
    ],
)
def test_scene_refuses_images_that_do_not_fit(left: np.ndarray, right: np.ndarray, message: str) -> None:
    with pytest.raises(DatasetError, match=message) as caught:
        Scene("Cones", left, right, None, RANGE)
    assert str(caught.value).startswith("Cones: ")


def test_scene_refuses_a_truth_of_another_size() -> None:
    with pytest.raises(DatasetError, match="Cones: truth is 2 x 3, the images 4 x 3"):
        Scene("Cones", np.zeros((4, 3), np.uint8), np.zeros((4, 3), np.uint8), truth(), RANGE)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (2, 3, 3)])
def test_scene_takes_gray_and_colour_of_8_and_16_bits(dtype: type, shape: tuple[int, ...]) -> None:
    image = np.zeros(shape, dtype)
    scene = Scene("one", image, image, None, RANGE)
    with pytest.raises(FrozenInstanceError):
        scene.name = "two"  # type: ignore[misc]


@pytest.fixture
def source(tmp_path: Path, save_image: Callable[..., Path]) -> SceneSource:
    files = {"left": save_image(tmp_path / "left.png"), "right": save_image(tmp_path / "right.png")}
    write_png16(tmp_path / "truth.png", np.full((6, 8), 2.0))
    return SceneSource(
        name="one",
        dataset="kitti2015",
        split="test",
        size=(6, 8),
        disparities=RANGE,
        reader="semidense.datasets.benchmarks.kitti",
        files={**files, "truth": tmp_path / "truth.png"},
        parameters={"scale": 4},
        has_truth=True,
    )


def test_load_joins_images_and_truth(source: SceneSource) -> None:
    scene = source.load()
    assert scene.name == "one"
    assert scene.left.shape == (6, 8, 3)
    assert scene.truth is not None
    assert scene.disparities == RANGE
    assert (scene.truth.disparity == 2).all()
    assert replace(source, has_truth=False).load().truth is None


def test_pickles_compares_and_hashes(source: SceneSource) -> None:
    copy = pickle.loads(pickle.dumps(source))
    assert copy == source
    assert hash(copy) == hash(source)
    assert copy != replace(source, parameters={"scale": 3})


def test_identity_names_content_not_places(source: SceneSource, tmp_path: Path) -> None:
    before = source.identity()
    assert json.loads(json.dumps(before)) == before
    assert str(tmp_path) not in json.dumps(before)
    assert before["reader"] == "semidense.datasets.benchmarks.kitti"
    assert before["parameters"] == {"scale": 4}
    elsewhere = {role: path.rename(path.with_suffix(".moved")) for role, path in source.files.items()}
    assert replace(source, name="two", files=elsewhere).identity() == before


@pytest.mark.parametrize(
    "role, images_change, truth_changes",
    [
        pytest.param("left", True, False, id="left image"),
        pytest.param("right", True, False, id="right image"),
        pytest.param("truth", False, True, id="truth"),
    ],
)
def test_a_byte_changes_only_the_identity_it_enters(
    source: SceneSource, role: str, images_change: bool, truth_changes: bool
) -> None:
    images, truths = source.image_identity(), source.truth_identity()
    path = source.files[role]
    path.write_bytes(path.read_bytes() + b"\0")
    assert (source.image_identity() != images) == images_change
    assert (source.truth_identity() != truths) == truth_changes


def test_images_and_truth_enter_separate_identities(source: SceneSource) -> None:
    assert set(source.image_identity()["files"]) == {"left", "right"}
    assert set(source.truth_identity()["files"]) == {"truth"}
    assert set(source.identity(["left"])["files"]) == {"left"}


def test_a_file_gone_since_listing_is_named(source: SceneSource) -> None:
    source.files["left"].unlink()
    for read in (source.load, source.load_images, source.identity):
        with pytest.raises(MissingFileError, match=r"left\.png: cannot be read"):
            read()


def test_a_size_changed_since_listing_is_named(source: SceneSource) -> None:
    changed = replace(source, size=(6, 9))
    with pytest.raises(DatasetError, match=r"left\.png: images of 6 x 8, but 6 x 9 was listed: list it again"):
        changed.load_images()
    with pytest.raises(DatasetError, match=r"\.png: truth of 6 x 8, but 6 x 9 is the images' size"):
        changed.load_truth()
