"""Messages and files of ROS: f 500 px, baseline 120 mm, centres 311 and 341."""

from pathlib import Path

import pytest

from semidense.datasets import Calibration, CalibrationError
from semidense.datasets.formats.calibration.cameras import PairCalibration
from semidense.datasets.formats.calibration.reading import read_cameras

LEFT = "[500, 0, 311, 0, 0, 500, 250, 0, 0, 0, 1, 0]"
RIGHT = "[500, 0, 341, -60, 0, 500, 250, 0, 0, 0, 1, 0]"
PART = "roi: {{x_offset: {x}, y_offset: {y}, height: {h}, width: {w}, do_rectify: true}}\n"
BINNED = "binning_x: 2\nbinning_y: 2\n"
ECHO = """header:
  stamp:
    sec: 1
  frame_id: left
height: 480
width: 640
distortion_model: plumb_bob
d:
- 0.0
p:
{rows}
binning_x: 0
binning_y: 0
roi:
  x_offset: 0
  y_offset: 0
  height: 0
  width: 0
  do_rectify: false
---
"""


def read(folder: Path, left: str, right: str) -> PairCalibration:
    files = [folder / "left.yaml", folder / "right.yaml"]
    for file, text in zip(files, (left, right), strict=True):
        file.write_text(text)
    return read_cameras(files)


def message(matrix: str, more: str = "") -> str:
    return f"height: 480\nwidth: 640\nP: {matrix}\n{more}"


def test_what_ros2_topic_echo_prints(tmp_path: Path) -> None:
    texts = [
        ECHO.format(rows="\n".join(f"- {float(item)}" for item in matrix.strip("[]").split(",")))
        for matrix in (LEFT, RIGHT)
    ]
    found = read(tmp_path, *texts)
    assert (found.calibration, found.size) == (Calibration(500, 120, 30, (311, 250)), (480, 640))
    assert read(tmp_path, texts[0] * 2, texts[1] * 2) == found


@pytest.mark.parametrize(
    ("more", "calibration", "size"),
    [
        pytest.param(
            PART.format(x=11, y=50, h=400, w=600), Calibration(500, 120, 30, (300, 200)), (400, 600), id="a part"
        ),
        pytest.param(BINNED, Calibration(250, 120, 15, (155.5, 125)), (240, 320), id="binned"),
        pytest.param(
            BINNED + PART.format(x=11, y=50, h=400, w=600),
            Calibration(250, 120, 15, (150, 100)),
            (200, 300),
            id="a part, binned: its offset is in full pixels",
        ),
        pytest.param(PART.format(x=0, y=0, h=0, w=0), Calibration(500, 120, 30, (311, 250)), (480, 640), id="all"),
    ],
)
def test_part_and_binning_of_a_message(
    tmp_path: Path, more: str, calibration: Calibration, size: tuple[int, int]
) -> None:
    """Worked out by hand as image_geometry does it: offsets first, then the first two rows through the binning."""
    found = read(tmp_path, message(LEFT, more), message(RIGHT, more))
    assert (found.calibration, found.size) == (calibration, size)


def test_parts_of_two_heights_shift_the_rows(tmp_path: Path) -> None:
    left, right = (message(each, PART.format(x=0, y=y, h=400, w=640)) for each, y in ((LEFT, 40), (RIGHT, 44)))
    (warning,) = read(tmp_path, left, right).warnings
    assert "210" in warning and "206" in warning


@pytest.mark.parametrize(
    ("left", "message_"),
    [
        pytest.param("height: x\nP: [1]\n", "height is 'x'; expected a whole number", id="a word for a number"),
        pytest.param("height: 480\nwidth: 640\n", "projection_matrix .or P. is no matrix", id="no matrix"),
        pytest.param("height: 90\nwidth: 100\nP: " + LEFT, r"image of \(480, 640\), but", id="two sizes"),
    ],
)
def test_a_bad_message_is_one_line(tmp_path: Path, left: str, message_: str) -> None:
    with pytest.raises(CalibrationError, match=message_):
        read(tmp_path, left, message(RIGHT))


def test_one_file_alone_asks_for_the_other(tmp_path: Path) -> None:
    (tmp_path / "left.yaml").write_text(message(LEFT))
    with pytest.raises(CalibrationError, match="one of ROS's two files, give the other too"):
        read_cameras([tmp_path / "left.yaml"])
