from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from semidense.datasets.benchmarks.middlebury import list_scenes
from semidense.datasets.errors import CalibrationError, DatasetError, ImageError, LayoutError
from semidense.datasets.scene import DisparityRange

Save = Callable[..., Path]


@pytest.fixture
def root(tmp_path: Path, save_image: Save, save_calibrated: Save) -> Path:
    """A root with a scene of every layout; truths are 2 px."""
    save_calibrated(tmp_path / "MiddEval3/trainingQ/Teddy", "disp0GT.pfm")
    save_image(tmp_path / "MiddEval3/trainingQ/Teddy/mask0nocc.png", mask(0, 128, 255))
    save_calibrated(tmp_path / "MiddEval3/testQ/Plants")
    save_calibrated(tmp_path / "2014/Adirondack", "disp0.pfm", "disp1.pfm")
    for folder, left, right, truths, level in (
        ("2001/Tsukuba", "im2", "im6", ["disp2"], 32),
        ("2001/Venus", "im2", "im6", ["disp2", "disp6"], 16),
        ("2003/Teddy", "im2", "im6", ["disp2", "disp6"], 8),
        ("2005/ThirdSize/Books", "view1", "view5", ["disp1", "disp5"], 6),
        ("2006/HalfSize/Aloe", "view1", "view5", ["disp1"], 4),
        ("2006/FullSize/Aloe", "view1", "view5", [], 0),
    ):
        save_pair(save_image, tmp_path / folder, left, right)
        for name in truths:
            save_image(tmp_path / folder / f"{name}.png", np.full((6, 8), level, np.uint8))
    return tmp_path


def save_pair(save_image: Save, folder: Path, left: str, right: str, suffix: str = ".png") -> None:
    for name in (left, right):
        save_image(folder / f"{name}{suffix}")


def mask(*values: int) -> np.ndarray:
    return np.resize(np.array(values, np.uint8), (6, 8))


ALL = {
    "2001/Tsukuba": ("middlebury/2001", "train", DisparityRange(0, 2), "warped truth"),
    "2001/Venus": ("middlebury/2001", "train", DisparityRange(0, 2), "left-right check"),
    "2003/Teddy": ("middlebury/2003", "train", DisparityRange(0, 2), "left-right check"),
    "2005/ThirdSize/Books": ("middlebury/2005", "train", DisparityRange(0, 2), "left-right check"),
    "2006/FullSize/Aloe": ("middlebury/2006", "train", DisparityRange(0, 255), None),
    "2006/HalfSize/Aloe": ("middlebury/2006", "train", DisparityRange(0, 2), "warped truth"),
    "2014/Adirondack": ("middlebury/2014", "test", DisparityRange(0, 3), "left-right check"),
    "MiddEval3/testQ/Plants": ("middlebury/MiddEval3", "test", DisparityRange(0, 3), None),
    "MiddEval3/trainingQ/Teddy": ("middlebury/MiddEval3", "test", DisparityRange(0, 3), "published"),
}


def test_a_root_lists_every_layout_in_the_order_of_names(root: Path) -> None:
    sources = list_scenes(str(root))
    assert [source.name for source in sources] == list(ALL)
    for source in sources:
        dataset, split, disparities, kind = ALL[source.name]
        assert (source.dataset, source.split, source.disparities) == (dataset, split, disparities), source.name
        assert source.size == (6, 8)
        assert source.has_truth == (kind is not None)


@pytest.mark.parametrize("name", [name for name, (*_, kind) in ALL.items() if kind])
def test_every_scale_gives_the_same_two_pixels(root: Path, name: str) -> None:
    source = next(source for source in list_scenes(str(root)) if source.name == name)
    truth = source.load_truth()
    assert truth is not None
    np.testing.assert_array_equal(truth.disparity, 2)
    assert truth.mask == ALL[name][3]
    if truth.mask != "published":
        np.testing.assert_array_equal(truth.nonocc, np.indices((6, 8))[1] >= 2)


@pytest.mark.parametrize(
    "below, names",
    [
        pytest.param("MiddEval3/trainingQ/Teddy", ["Teddy"], id="one scene"),
        pytest.param("MiddEval3/trainingQ", ["Teddy"], id="a collection"),
        pytest.param("MiddEval3", ["testQ/Plants", "trainingQ/Teddy"], id="training and test"),
        pytest.param("2005", ["ThirdSize/Books"], id="a year"),
        pytest.param("2006/HalfSize", ["Aloe"], id="a size"),
        pytest.param("2006/HalfSize/Aloe", ["Aloe"], id="one scene of a size"),
    ],
)
def test_any_folder_may_be_given(root: Path, below: str, names: list[str]) -> None:
    assert [source.name for source in list_scenes(str(root / below))] == names


def test_a_relative_folder_keeps_its_name(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(root / "2003/Teddy")
    assert [(source.name, source.dataset) for source in list_scenes(".")] == [("Teddy", "middlebury/2003")]


def test_only_255_of_the_published_mask_is_visible(root: Path) -> None:
    (source,) = list_scenes(str(root / "MiddEval3/trainingQ"))
    truth = source.load_truth()
    assert truth is not None
    np.testing.assert_array_equal(truth.nonocc, mask(0, 128, 255) == 255)


def test_the_published_ppm_and_pgm_are_read(tmp_path: Path, save_image: Save) -> None:
    save_pair(save_image, tmp_path / "venus", "im2", "im6", ".ppm")
    save_image(tmp_path / "venus/disp2.pgm", np.full((6, 8), 12, np.uint8))
    (source,) = list_scenes(str(tmp_path))
    truth = source.load().truth
    assert truth is not None
    assert (truth.disparity == 1.5).all()
    assert source.disparities == DisparityRange(0, 2)


def test_zero_is_unknown(root: Path, save_image: Save) -> None:
    level = np.full((6, 8), 8, np.uint8)
    level[0] = 0
    save_image(root / "2003/Teddy/disp2.png", level)
    (source,) = list_scenes(str(root / "2003"))
    truth = source.load_truth()
    assert truth is not None
    assert np.isnan(truth.disparity[0]).all()
    assert not truth.nonocc[0].any()


def test_hidden_folders_and_folders_inside_a_scene_are_left_alone(root: Path, save_image: Save) -> None:
    save_pair(save_image, root / ".trash/Cones", "im2", "im6")
    save_pair(save_image, root / "2005/ThirdSize/Books/Illum1", "view1", "view5")
    assert [source.name for source in list_scenes(str(root))] == list(ALL)


@pytest.mark.parametrize(
    "gone, message",
    [
        pytest.param("MiddEval3/trainingQ/Teddy/im1.png", "no im1.png; expected im0.png im1.png calib.txt", id="right"),
        pytest.param("MiddEval3/testQ/Plants/calib.txt", "no calib.txt; .*found im0.png, im1.png", id="calib.txt"),
        pytest.param("2003/Teddy/im6.png", "no im6; expected im2 im6", id="right of 2003"),
        pytest.param("2005/ThirdSize/Books/view1.png", "no view1; expected view1 view5", id="left of 2005"),
    ],
)
def test_a_missing_file_is_named_with_what_is_there(root: Path, gone: str, message: str) -> None:
    (root / gone).unlink()
    with pytest.raises(LayoutError, match=message):
        list_scenes(str(root))


def test_no_scene_names_the_patterns_and_the_contents(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").touch()
    with pytest.raises(
        LayoutError, match=r"expected folders of im0.png .*; im2 im6 .*; view1 view5 .*; found notes.txt"
    ):
        list_scenes(str(tmp_path))


@pytest.mark.parametrize(
    "folder, left, right, message",
    [
        pytest.param("2005/Books", "view1", "view5", "ThirdSize or HalfSize or FullSize", id="no size"),
        pytest.param("2003/Mine", "im2", "im6", "the scale of 'mine' is not known", id="not a published scene"),
    ],
)
def test_a_scale_that_nothing_tells_is_refused(
    tmp_path: Path, save_image: Save, folder: str, left: str, right: str, message: str
) -> None:
    save_pair(save_image, tmp_path / folder, left, right)
    with pytest.raises(LayoutError, match=message):
        list_scenes(str(tmp_path))


def test_a_calibration_of_another_size_is_refused(root: Path, save_image: Save) -> None:
    save_image(root / "2014/Adirondack/im0.png", np.zeros((12, 16, 3), np.uint8))
    with pytest.raises(CalibrationError, match="height=6 and width=8, but the image is 12 x 16"):
        list_scenes(str(root))


@pytest.mark.parametrize(
    "name, pixels, kind, message",
    [
        pytest.param("2003/Teddy/disp2.png", np.zeros((6, 8), np.uint8), ImageError, "no known disparity", id="all 0"),
        pytest.param(
            "2003/Teddy/disp2.png", np.zeros((6, 8, 3), np.uint8), ImageError, "8-bit gray", id="colour truth"
        ),
        pytest.param("2003/Teddy/disp2.png", np.ones((6, 8), np.uint16), ImageError, "8-bit gray", id="16-bit truth"),
        pytest.param(
            "2003/Teddy/disp6.png", np.ones((6, 9), np.uint8), DatasetError, "right truth", id="right truth's size"
        ),
        pytest.param("2003/Teddy/nonocc.png", np.ones((6, 9), np.uint8), ImageError, "a mask of", id="the mask's size"),
        pytest.param("2003/Teddy/im6.png", np.ones((6, 9, 3), np.uint8), DatasetError, "both views", id="right's size"),
    ],
)
def test_files_that_do_not_fit_are_refused(
    root: Path, save_image: Save, name: str, pixels: np.ndarray, kind: type[DatasetError], message: str
) -> None:
    save_image(root / name, pixels)
    with pytest.raises(kind, match=message):
        list_scenes(str(root / "2003"))[0].load()


@pytest.fixture
def lit(root: Path, save_image: Save) -> Path:
    """A root with scenes of several lightings and exposures; the brightness of a picture tells its condition."""
    scene = root / "2005/ThirdSize/Books"
    for lighting, exposure, view in ((1, 0, 1), (1, 0, 5), (3, 2, 1), (3, 2, 5), (3, 2, 3)):
        level = np.full((6, 8, 3), 10 * lighting + exposure, np.uint8)
        save_image(scene / f"Illum{lighting}/Exp{exposure}/view{view}.png", level)
    for name in ("im1E.png", "im1L.png", "ambient/L1/im0e0.png", "ambient/L1/im1e0.png", "ambient/L1/im1e1.png"):
        save_image(root / "2014/Adirondack" / name, np.full((6, 8, 3), len(name), np.uint8))
    return root


@pytest.mark.parametrize(
    "scene, options, names",
    [
        ("2014/Adirondack", ",right=E", ["Adirondack@E"]),
        ("2014/Adirondack", ",right=L1.e1", ["Adirondack@L1.e1"]),
        ("2014/Adirondack", ",right=*", [f"Adirondack@{each}" for each in ("E", "L", "L1.e0", "L1.e1")]),
        ("2014/Adirondack", ",left=L1.e0,right=L", ["Adirondack@L1.e0-L"]),
        ("2014/Adirondack", ",left=*", ["Adirondack@L1.e0-default"]),
        ("2005/ThirdSize/Books", ",right=Illum1.Exp0", ["Books@Illum1.Exp0"]),
        (
            "2005/ThirdSize/Books",
            ",right=*,left=*",
            [
                f"Books@{left}-{right}"
                for left in ("Illum1.Exp0", "Illum3.Exp2")
                for right in ("Illum1.Exp0", "Illum3.Exp2")
            ],
        ),
    ],
)
def test_other_lightings_and_exposures_are_read(lit: Path, scene: str, options: str, names: list[str]) -> None:
    found = list_scenes(f"{lit / scene}{options}")
    assert [each.name for each in found] == names
    for each in found:
        left, right = each.load_images()
        condition = each.name.partition("@")[2].split("-")
        for view, text in ((right, condition[-1]), (left, condition[0] if len(condition) == 2 else "default")):
            levels = {"default": 100, "E": 8, "L": 8, "L1.e0": 20, "L1.e1": 20, "Illum1.Exp0": 10, "Illum3.Exp2": 32}
            assert (view == levels[text]).all()
        assert each.load_truth() is not None


def test_a_condition_that_is_not_there_is_told_with_those_that_are(lit: Path) -> None:
    with pytest.raises(LayoutError, match=r"no right view under 'Illum9.Exp0'; there are Illum1.Exp0, Illum3.Exp2"):
        list_scenes(f"{lit / '2005'},right=Illum9.Exp0")
    with pytest.raises(LayoutError, match=r"no left view under '\*'; there are none"):
        list_scenes(f"{lit / '2003'},left=*")


def test_a_scene_of_conditions_alone_asks_which(lit: Path) -> None:
    for view in ("view1", "view5"):
        (lit / f"2005/ThirdSize/Books/{view}.png").unlink()
    with pytest.raises(LayoutError, match=r"add to the folder which to take, such as ,left=Illum1\.Exp1"):
        list_scenes(str(lit / "2005"))
    assert len(list_scenes(f"{lit / '2005'},left=Illum3.Exp2,right=*")) == 2


def test_2021_and_a_published_right_truth_are_known(tmp_path: Path, save_calibrated: Save) -> None:
    save_calibrated(tmp_path / "2021/data/chess1", "disp0.pfm", "disp1.pfm")
    save_calibrated(tmp_path / "MiddEval3/trainingQ/Teddy", "disp0GT.pfm", "disp1GT.pfm")
    assert [each.dataset for each in list_scenes(str(tmp_path))] == ["middlebury/2021", "middlebury/MiddEval3"]
    for each in list_scenes(str(tmp_path)):
        truth = each.load_truth()
        assert truth is not None and truth.mask == "left-right check"


def test_the_published_names_of_tsukuba_are_read(tmp_path: Path, save_image: Save) -> None:
    save_pair(save_image, tmp_path / "tsukuba", "scene1.row3.col3", "scene1.row3.col4", ".ppm")
    save_image(tmp_path / "tsukuba/truedisp.row3.col3.pgm", np.full((6, 8), 32, np.uint8))
    truth = list_scenes(str(tmp_path))[0].load_truth()
    assert truth is not None and (truth.disparity == 2).all()
