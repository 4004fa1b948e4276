from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from semidense.datasets.benchmarks.kitti2015 import list_scenes
from semidense.datasets.errors import DatasetError, LayoutError
from semidense.datasets.formats.png16 import write_png16
from semidense.datasets.scene import DisparityRange

Save = Callable[..., Path]
NAMES = ("000003_10.png", "000012_10.png")
NOC = np.full((6, 8), np.nan)
NOC[3, 4] = 2.5
OCC = NOC.copy()
OCC[3, 0] = 7


@pytest.fixture
def root(tmp_path: Path, save_image: Save) -> Path:
    for name in NAMES:
        for folder in ("image_2", "image_3"):
            save_image(tmp_path / "training" / folder / name)
        (tmp_path / "training/disp_noc_0").mkdir(exist_ok=True)
        write_png16(tmp_path / "training/disp_noc_0" / name, NOC)
    return tmp_path


@pytest.mark.parametrize("below", [".", "training"])
def test_root_and_training_folder_list_the_same(root: Path, below: str) -> None:
    sources = list_scenes(str(root / below))
    assert [source.name for source in sources] == ["000003_10", "000012_10"]
    for source in sources:
        assert (source.dataset, source.split, source.size) == ("kitti2015", "test", (6, 8))
        assert source.disparities == DisparityRange(0, 127)
        assert {path.name for path in source.files.values()} == {f"{source.name}.png"}


def test_without_occluded_truth_all_that_is_known_is_visible(root: Path) -> None:
    truth = list_scenes(str(root))[0].load_truth()
    assert truth is not None
    np.testing.assert_array_equal(truth.disparity, NOC)
    np.testing.assert_array_equal(truth.nonocc, ~np.isnan(NOC))
    assert truth.mask == "non-occluded truth"


def test_the_truth_of_hidden_pixels_alone_does_not_tell_which_are_visible(root: Path) -> None:
    (root / "training/disp_noc_0").rename(root / "training/disp_occ_0")
    truth = list_scenes(str(root))[0].load_truth()
    assert truth is not None and truth.mask == "none"


def test_with_occluded_truth_the_other_is_its_mask(root: Path) -> None:
    (root / "training/disp_occ_0").mkdir()
    for name in NAMES:
        write_png16(root / "training/disp_occ_0" / name, OCC)
    truth = list_scenes(str(root))[0].load_truth()
    assert truth is not None
    np.testing.assert_array_equal(truth.disparity, OCC)
    np.testing.assert_array_equal(truth.nonocc, ~np.isnan(NOC))
    write_png16(root / "training/disp_occ_0" / NAMES[0], OCC[:5])
    with pytest.raises(DatasetError, match="disp_noc_0"):
        list_scenes(str(root))[0].load_truth()


def test_files_pair_by_name_never_by_order(root: Path, save_image: Save) -> None:
    save_image(root / "training/image_3/000001_10.png")
    (root / "training/image_3" / NAMES[0]).unlink()
    with pytest.raises(LayoutError, match=r"image_3: lacks 1 of the 2 frames of image_2, 000003_10\.png first"):
        list_scenes(str(root))


def test_second_frames_are_left_alone(root: Path, save_image: Save) -> None:
    save_image(root / "training/image_2/000003_11.png")
    assert len(list_scenes(str(root))) == 2


def test_the_testing_folder_has_no_truth(tmp_path: Path, save_image: Save) -> None:
    for folder in ("image_2", "image_3"):
        save_image(tmp_path / "testing" / folder / NAMES[0])
    (source,) = list_scenes(str(tmp_path / "testing"))
    assert not source.has_truth
    assert source.load().truth is None


def test_no_scene_names_what_was_expected_and_found(tmp_path: Path) -> None:
    (tmp_path / "image_02").mkdir()
    with pytest.raises(LayoutError, match=r"expected \[training/\]image_2/\*_10.png and image_3; found image_02"):
        list_scenes(str(tmp_path))


def test_the_files_that_macos_adds_are_passed_over(root: Path) -> None:
    (root / "training/image_2/._000003_10.png").write_bytes(b"Mac OS X")
    assert len(list_scenes(str(root))) == 2


def test_a_calibration_gives_depth(root: Path) -> None:
    folder = root / "training/calib_cam_to_cam"
    folder.mkdir()
    (folder / "000003.txt").write_text(
        "S_rect_02: 8 6\nP_rect_02: 7 0 4 0.7 0 7 3 0 0 0 1 0\nS_rect_03: 8 6\nP_rect_03: 7 0 4 -3.5 0 7 3 0 0 0 1 0\n"
    )
    known, other = (source.calibration for source in list_scenes(str(root)))
    assert known is not None
    assert (known.focal, known.centre, round(known.baseline, 6)) == (7, (4, 3), 600)
    assert other is None
