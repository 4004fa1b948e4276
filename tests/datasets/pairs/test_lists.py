from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semidense.datasets import DatasetError, open_dataset

CALIB = (
    "cam0=[100 0 4; 0 100 3; 0 0 1]\ncam1=[100 0 5; 0 100 3; 0 0 1]\ndoffs=1\nbaseline=50\nwidth=8\nheight=6\nndisp=4\n"
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("left.png", "right.png", "a;1.png", "a,2.png"):
        Image.fromarray(np.zeros((6, 8), np.uint8)).save(tmp_path / name)
    (tmp_path / "calib.txt").write_text(CALIB)
    return tmp_path


@pytest.mark.parametrize(
    ("text", "names"),
    [
        pytest.param("left.png;right.png\n", ("left.png", "right.png"), id="semicolons"),
        pytest.param("Left;Right;Calib\nleft.png;right.png;calib.txt\n", ("left.png", "right.png"), id="capitals"),
        pytest.param("left.png\tright.png\n", ("left.png", "right.png"), id="tabs"),
        pytest.param(
            "# made by hand\nLEFT,RIGHT\nleft.png,right.png\n", ("left.png", "right.png"), id="a remark first"
        ),
        pytest.param("a;1.png,right.png\n", ("a;1.png", "right.png"), id="a semicolon in a name"),
        pytest.param("a,2.png;right.png\n", ("a,2.png", "right.png"), id="a comma in a name"),
        pytest.param("Left_Image,Right image\nleft.png,right.png\n", ("left.png", "right.png"), id="longer heads"),
        pytest.param("left.png,right.png,,\n", ("left.png", "right.png"), id="empty fields at the end"),
        pytest.param("\ufeffleft.png;right.png\r\n", ("left.png", "right.png"), id="as a spreadsheet saves it"),
    ],
)
def test_lists_as_spreadsheets_write_them(folder: Path, text: str, names: tuple[str, str]) -> None:
    (folder / "pairs.csv").write_text(text, newline="")
    (scene,) = open_dataset(f"pair:{folder}/pairs.csv").scenes
    assert (scene.files["left"].name, scene.files["right"].name) == names


def test_a_list_in_utf_16(folder: Path) -> None:
    (folder / "pairs.txt").write_text("Left\tRight\nleft.png\tright.png\n", encoding="utf-16")
    (scene,) = open_dataset(f"pair:{folder}/pairs.txt").scenes
    assert scene.files["right"].name == "right.png"


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
        pytest.param("\xff\xfe\0", "not plain text; .* saved as UTF-8", id="binary"),
    ],
)
def test_a_bad_list_names_its_line(folder: Path, text: str, message: str) -> None:
    (folder / "pairs.csv").write_bytes(text.encode("latin-1"))
    with pytest.raises(DatasetError, match=message):
        open_dataset(f"pair:{folder}/pairs.csv")


def test_a_list_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="cannot be read"):
        open_dataset(f"pair:{tmp_path}/none.csv")
