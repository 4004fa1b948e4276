from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from semidense.datasets.benchmarks.eth3d import list_scenes
from semidense.datasets.errors import LayoutError
from semidense.datasets.formats.pfm import write_pfm
from semidense.datasets.scene import Calibration, DisparityRange

Save = Callable[..., Path]


@pytest.mark.parametrize(
    "below, name",
    [
        pytest.param(".", "two_view_training/playground_1l", id="the folder above"),
        pytest.param("two_view_training", "playground_1l", id="the folder of scenes"),
        pytest.param("two_view_training/playground_1l", "playground_1l", id="one scene"),
    ],
)
def test_lists_scenes_at_any_level(tmp_path: Path, save_calibrated: Save, below: str, name: str) -> None:
    save_calibrated(tmp_path / "two_view_training/playground_1l", "disp0GT.pfm")
    (source,) = list_scenes(str(tmp_path / below))
    assert (source.name, source.dataset, source.split, source.size) == (name, "eth3d", "test", (6, 8))
    assert source.disparities == DisparityRange(0, 63), "ndisp of calib.txt says nothing here"
    assert source.calibration == Calibration(focal=100, baseline=50, doffs=1, centre=(4, 3))
    truth = source.load_truth()
    assert truth is not None
    assert truth.mask == "warped truth"
    np.testing.assert_array_equal(truth.nonocc, np.indices((6, 8))[1] >= 2)


def test_truth_and_mask_may_stand_in_their_own_folder(tmp_path: Path, save_calibrated: Save, save_image: Save) -> None:
    save_calibrated(tmp_path / "two_view_training/forest_1s")
    truths = tmp_path / "two_view_training_gt/forest_1s"
    save_image(truths / "mask0nocc.png", np.full((6, 8), 255, np.uint8))
    write_pfm(truths / "disp0GT.pfm", np.full((6, 8), 1, np.float32))
    (source,) = list_scenes(str(tmp_path))
    truth = source.load_truth()
    assert truth is not None
    assert truth.mask == "published"
    assert truth.nonocc.all()


def test_a_scene_without_truth_has_none(tmp_path: Path, save_calibrated: Save) -> None:
    save_calibrated(tmp_path / "lakeside_1l")
    assert list_scenes(str(tmp_path))[0].load().truth is None


def test_a_mismatch_names_both_sides(tmp_path: Path, save_calibrated: Save) -> None:
    with pytest.raises(LayoutError, match=r"expected folders of im0.png im1.png calib.txt .*; found nothing"):
        list_scenes(str(tmp_path))
    (save_calibrated(tmp_path / "one") / "calib.txt").unlink()
    with pytest.raises(LayoutError, match=r"no calib.txt; .*found im0.png, im1.png"):
        list_scenes(str(tmp_path))
