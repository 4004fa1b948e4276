from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from semidense.datasets import DisparityRange, open_dataset
from semidense.datasets.errors import LayoutError
from semidense.datasets.formats.png16 import write_png16

Save = Callable[..., Path]
NAME = "000007_10.png"
TRUTH = np.full((6, 8), np.nan)
TRUTH[3, 4] = 2.5
CALIB = "P0: 7 0 4 0 0 7 3 0 0 0 1 0\nP1: 7 0 4 -3.5 0 7 3 0 0 0 1 0\nP2: 7 0 4 0.7 0 7 3 0 0 0 1 0\n"
CALIB += "P3: 7 0 4 -2.1 0 7 3 0 0 0 1 0\n"


def save(root: Path, save_image: Save, *folders: str) -> Path:
    for folder in folders:
        save_image(root / "training" / folder / NAME)
    (root / "training/calib").mkdir(exist_ok=True)
    (root / "training/calib/000007.txt").write_text(CALIB)
    return root


@pytest.mark.parametrize(
    ("folders", "left", "baseline"),
    [
        pytest.param(["image_0", "image_1"], "image_0", 500, id="gray"),
        pytest.param(["colored_0", "colored_1"], "colored_0", 400, id="colour, whose left camera is not the origin"),
        pytest.param(["colored_0", "colored_1", "image_0", "image_1"], "image_0", 500, id="both"),
    ],
)
def test_gray_and_colour(tmp_path: Path, save_image: Save, folders: list[str], left: str, baseline: float) -> None:
    (scene,) = open_dataset(f"kitti2012:{save(tmp_path, save_image, *folders)}").scenes
    assert scene.files["left"].parent.name == left
    assert scene.calibration is not None
    assert round(scene.calibration.baseline, 6) == baseline
    assert (scene.split, scene.has_truth, scene.disparities) == ("test", False, DisparityRange(0, 255))
    assert scene.warnings == ()


def test_the_range_is_that_of_the_truth(tmp_path: Path, save_image: Save) -> None:
    save(tmp_path, save_image, "image_0", "image_1")
    (tmp_path / "training/disp_noc").mkdir()
    write_png16(tmp_path / "training/disp_noc" / NAME, TRUTH)
    (scene,) = open_dataset(str(tmp_path)).scenes
    assert (scene.dataset, scene.split, scene.disparities) == ("kitti2012", "train", DisparityRange(0, 3))
    truth = scene.load_truth()
    assert truth is not None
    np.testing.assert_array_equal(truth.disparity, TRUTH)


def test_no_scene_names_what_was_expected(tmp_path: Path) -> None:
    with pytest.raises(LayoutError, match=r"no KITTI 2012 scene; expected \[training/\]image_0/\*_10.png and image_1"):
        open_dataset(f"kitti2012:{tmp_path}")


def test_joined_scenes_of_one_name_are_told_apart_by_their_data_set(tmp_path: Path, save_image: Save) -> None:
    save(tmp_path, save_image, "image_0", "image_1", "image_2", "image_3")
    both = open_dataset(f"kitti2012:{tmp_path}+kitti2015:{tmp_path}+motorcycle")
    assert [scene.name for scene in both.scenes] == ["kitti2012/000007_10", "kitti2015/000007_10", "Motorcycle"]
    assert [scene.dataset for scene in both.scenes] == ["kitti2012", "kitti2015", "motorcycle"]
