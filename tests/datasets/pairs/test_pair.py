from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semidense.datasets import Calibration, CalibrationError, DatasetError, DisparityRange, LayoutError, open_dataset
from semidense.datasets.pairs.arrays import array_pair
from semidense.datasets.pairs.images import harmonised
from semidense.datasets.pairs.pair import PairOptions, pair_spec

CAMERAS = "cam0=[100 0 4; 0 100 3; 0 0 1]\ncam1=[100 0 5; 0 100 3; 0 0 1]\n"
CALIB = CAMERAS + "doffs=1\nbaseline=50\nwidth={w}\nheight=6\nndisp={n}\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("left.png", "right.png"):
        Image.fromarray(np.zeros((6, 8, 3), np.uint8)).save(tmp_path / name)
    (tmp_path / "calib.txt").write_text(CALIB.format(w=8, n=4))
    return tmp_path


def spec(folder: Path, *more: str) -> str:
    return ",".join([f"pair:{folder}/left.png,{folder}/right.png", *more])


@pytest.mark.parametrize(
    ("given", "disparities", "open_ends"),
    [
        pytest.param([], (-7, 7), ("minimum", "maximum"), id="nothing known: what the width allows"),
        pytest.param(["d_max=5"], (-7, 5), ("minimum",), id="one end given"),
        pytest.param(["d_min=-2", "d_max=5"], (-2, 5), (), id="both ends, one negative"),
        pytest.param(["calib={}/calib.txt"], (0, 3), (), id="the calibration's"),
        pytest.param(["calib={}/calib.txt", "d_max=5"], (0, 5), (), id="the user's goes first"),
    ],
)
def test_the_range_is_what_is_known(
    folder: Path, given: list[str], disparities: tuple[int, int], open_ends: tuple[str, ...]
) -> None:
    (scene,) = open_dataset(spec(folder, *(text.format(folder) for text in given))).scenes
    assert (scene.disparities, scene.open_ends) == (DisparityRange(*disparities), open_ends)
    assert (scene.name, scene.size, scene.dataset) == (folder.name, (6, 8), "pair")


def test_a_calibration_whose_count_is_the_width_bounds_nothing(folder: Path) -> None:
    (folder / "calib.txt").write_text(CALIB.format(w=8, n=8))
    (scene,) = open_dataset(spec(folder, f"calib={folder}/calib.txt")).scenes
    assert scene.open_ends == ("minimum", "maximum")
    assert scene.calibration == Calibration(100, 50, 1, (4, 3))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        pytest.param(["d_max=8"], "only 8 px wide", id="wider than the image"),
        pytest.param(["d_max=x"], "expected a whole number", id="no number"),
        pytest.param(["d_min=5", "d_max=2"], r"\[5, 2\] is empty", id="empty range"),
        pytest.param(["c.png"], "3 paths", id="three paths"),
        pytest.param(["calib={}/none.txt"], "none.txt", id="no such calibration"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(folder: Path, given: list[str], message: str) -> None:
    with pytest.raises(DatasetError, match=message) as refused:
        open_dataset(spec(folder, *(text.format(folder) for text in given)))
    assert "\n" not in str(refused.value)


def test_a_calibration_of_another_size_is_refused(folder: Path) -> None:
    (folder / "calib.txt").write_text(CALIB.format(w=9, n=4))
    with pytest.raises(CalibrationError, match="6 x 9 pixels, the images have 6 x 8"):
        open_dataset(spec(folder, f"calib={folder}/calib.txt"))


def test_views_of_different_size_are_refused_before_a_pixel_is_read(folder: Path) -> None:
    Image.fromarray(np.zeros((6, 9), np.uint8)).save(folder / "right.png")
    with pytest.raises(DatasetError, match=r"right.png: 6 x 9 pixels, but .*left.png has 6 x 8"):
        open_dataset(spec(folder))


def test_a_single_path_must_be_a_list(folder: Path) -> None:
    with pytest.raises(DatasetError, match="must be a list"):
        open_dataset(f"pair:{folder}/left.png")


def test_a_path_with_a_comma_survives_the_specification(folder: Path) -> None:
    (folder / "left.png").rename(folder / "a, b.png")
    text = pair_spec([str(folder / "a, b.png"), str(folder / "right.png")], PairOptions(d_min=1, d_max=2))
    assert open_dataset(text).scenes[0].files["left"].name == "a, b.png"


def test_a_list_gives_each_pair_its_calibration(folder: Path) -> None:
    (folder / "pairs.csv").write_text("left,right\n# a remark\nleft.png, right.png, calib.txt\n\nright.png,left.png\n")
    one, other = open_dataset(f"pair:{folder}/pairs.csv").scenes
    assert (one.calibration is None, other.calibration is None) == (False, True)
    assert one.name != other.name


@pytest.mark.parametrize(
    ("text", "message"),
    [
        pytest.param("", "names no pair", id="empty"),
        pytest.param("left.png\n", "line 1: 'left.png'", id="one field"),
        pytest.param("left.png,none.png\n", "line 1: .*none.png: no such file", id="missing file"),
        pytest.param("\xff\xfe\0", "no plain text", id="binary"),
    ],
)
def test_a_bad_list_names_its_line(folder: Path, text: str, message: str) -> None:
    (folder / "pairs.csv").write_bytes(text.encode("latin-1"))
    with pytest.raises(DatasetError, match=message):
        open_dataset(f"pair:{folder}/pairs.csv")


def test_a_list_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="cannot be read"):
        open_dataset(f"pair:{tmp_path}/none.csv")


U8, U16 = np.uint8, np.uint16


@pytest.mark.parametrize(
    ("left", "right", "expected"),
    [
        pytest.param(U8([[7]]), U8([[9]]), ([[7]], [[9]]), id="alike stays"),
        pytest.param(U8([[255]]), U16([[256]]), ([[65535]], [[256]]), id="8 bits become 16"),
        pytest.param(U8([[7]]), U8([[[1, 2, 3]]]), ([[[7, 7, 7]]], [[[1, 2, 3]]]), id="gray becomes colour"),
        pytest.param(U16([[[1, 2, 3]]]), U8([[1]]), ([[[1, 2, 3]]], [[[257, 257, 257]]]), id="both at once"),
    ],
)
def test_views_are_brought_to_the_richer_kind(
    left: np.ndarray, right: np.ndarray, expected: tuple[object, object]
) -> None:
    made = harmonised(left, right)
    assert (made[0].tolist(), made[1].tolist()) == expected
    assert made[0].dtype == made[1].dtype


def test_arrays_are_known_by_their_content() -> None:
    left, right = (np.full((4, 5), value, np.uint8) for value in (1, 2))
    (one,), (other,), (deep,) = (
        array_pair(left, last, PairOptions()).scenes for last in (right, right + 1, right.astype(np.uint16))
    )
    digests = [scene.image_identity()["files"] for scene in (one, other, deep)]
    assert digests[0]["left"] == digests[1]["left"]
    assert len({each["right"] for each in digests}) == 3
    assert one.load_images()[0].tolist() == left.tolist()


@pytest.mark.parametrize(
    ("shape", "dtype", "message"),
    [
        pytest.param((4, 5), np.float64, "float64", id="floats"),
        pytest.param((4,), np.uint8, "uint8, 4", id="one axis"),
        pytest.param((4, 5, 2), np.uint8, "4 x 5 x 2", id="two bands"),
        pytest.param((0, 5), np.uint8, "empty", id="no pixel"),
        pytest.param((), np.uint8, "a scalar", id="a scalar"),
    ],
)
def test_what_is_no_image_is_refused(shape: tuple[int, ...], dtype: type, message: str) -> None:
    bad = np.zeros(shape, dtype)
    with pytest.raises(DatasetError, match=message):
        array_pair(bad, bad, PairOptions())


@pytest.mark.parametrize("bands", [1, 4])
def test_a_single_band_and_alpha_are_understood(bands: int) -> None:
    view = np.zeros((4, 5, bands), np.uint8)
    loaded = array_pair(view, view, PairOptions()).scenes[0].load_images()
    assert loaded[0].shape == ((4, 5) if bands == 1 else (4, 5, 3))


@pytest.fixture
def views(tmp_path: Path) -> Callable[..., None]:
    def save(*names: str) -> None:
        for name in names:
            path = tmp_path / name
            path.parent.mkdir(exist_ok=True)
            Image.fromarray(np.zeros((4, 5), np.uint8)).save(path)

    return save


@pytest.mark.parametrize(
    ("names", "sides", "expected"),
    [
        pytest.param(["l/7.png", "l/8.png", "r/8.png", "r/7.png"], ("l", "r"), ["7", "8"], id="the same names"),
        pytest.param(["l/left_7.png", "r/right_7.png"], ("l", "r"), ["7"], id="names that tell the side"),
        pytest.param(["l/a_L.png", "l/a_R.png"], ("l/*_L.png", "l/*_R.png"), ["a"], id="patterns"),
        pytest.param(
            ["l/1.png", "l/notes.txt.png", "r/1.png", "r/notes.txt.png"], ("l", "r"), ["1", "notes_txt"], id="dots"
        ),
    ],
)
def test_views_are_paired_by_name(
    views: Callable[..., None], tmp_path: Path, names: list[str], sides: tuple[str, str], expected: list[str]
) -> None:
    views(*names)
    scenes = open_dataset("pair:" + ",".join(str(tmp_path / side) for side in sides)).scenes
    assert [scene.name for scene in scenes] == expected
    for scene in scenes:
        assert scene.files["left"] != scene.files["right"]


@pytest.mark.parametrize(
    ("names", "sides", "message"),
    [
        pytest.param(["l/1.png", "l/2.png", "r/1.png"], ("l", "r"), "1 of 2 images have no .*'2' first", id="left"),
        pytest.param(["l/1.png", "r/1.png", "r/3.png"], ("l", "r"), "'3' first", id="a right one too many"),
        pytest.param(["l/a_left.png", "l/a_right.png", "r/b.png"], ("l", "r"), "several images are 'a'", id="twice"),
        pytest.param(["l/1.png", "r/1.png"], ("l", "r/1.png"), "one is a folder", id="a folder and a file"),
        pytest.param(["l/1.png"], ("l/*.png", "r/*"), "cannot be listed", id="no such folder"),
        pytest.param(["l/1.png"], ("l/*.png", "l/*.jpg"), "no image there", id="a pattern that fits nothing"),
        pytest.param(["l/1.png"], ("l/*.*", "l/*.png"), "exactly one", id="two stars"),
        pytest.param(["l/1.png"], ("l/1.png", "l/2.png"), "no such file", id="no such file"),
    ],
)  # fmt: skip
def test_views_without_a_counterpart_are_named(
    views: Callable[..., None], tmp_path: Path, names: list[str], sides: tuple[str, str], message: str
) -> None:
    views(*names)
    with pytest.raises((LayoutError, DatasetError), match=message):
        open_dataset("pair:" + ",".join(str(tmp_path / side) for side in sides))
