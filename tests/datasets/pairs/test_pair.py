from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semidense.datasets import Calibration, CalibrationError, DatasetError, DisparityRange, open_dataset
from semidense.datasets.pairs.options import PairOptions, pair_spec

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
        pytest.param(["calib={}/calib.txt"], (-7, 3), ("minimum",), id="a calibration knows the upper end only"),
        pytest.param(["calib={}/calib.txt", "d_min=0"], (0, 3), (), id="each end from where it is known"),
        pytest.param(["calib={}/calib.txt", "d_max=5"], (-7, 5), ("minimum",), id="the user's goes first"),
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
    with pytest.raises(CalibrationError, match="6 x 9 pixels, the images have 6 x 8: another shape"):
        open_dataset(spec(folder, f"calib={folder}/calib.txt"))


def test_views_of_different_size_are_refused_before_a_pixel_is_read(folder: Path) -> None:
    Image.fromarray(np.zeros((6, 9), np.uint8)).save(folder / "right.png")
    with pytest.raises(DatasetError, match=r"right.png: 6 x 9 pixels, but .*left.png has 6 x 8"):
        open_dataset(spec(folder))


def test_a_single_path_must_be_a_list(folder: Path) -> None:
    with pytest.raises(DatasetError, match="the right view is missing"):
        open_dataset(f"pair:{folder}/left.png")


def test_a_path_with_a_comma_survives_the_specification(folder: Path) -> None:
    (folder / "left.png").rename(folder / "a, b.png")
    text = pair_spec([str(folder / "a, b.png"), str(folder / "right.png")], PairOptions(d_min=1, d_max=2))
    assert open_dataset(text).scenes[0].files["left"].name == "a, b.png"
