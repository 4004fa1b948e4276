"""Files that ROS's camera_calibration writes: f 500 px, baseline 120 mm, centres 311 and 341."""

from pathlib import Path

import pytest

from semidense.datasets import Calibration, CalibrationError
from semidense.datasets.formats.calibration.reading import read_cameras

CAMERA = """# oST version 5.0 parameters


[image]

width
640

height
480

[narrow_stereo/{side}]

camera matrix
612.000000 0.000000 300.000000
0.000000 612.000000 240.000000
0.000000 0.000000 1.000000

distortion
-0.300000 0.100000 0.000000 0.000000 0.000000

rectification
1.000000 0.000000 0.000000
0.000000 1.000000 0.000000
0.000000 0.000000 1.000000

projection
500.000000 0.000000 {projection}
0.000000 500.000000 250.000000 0.000000
0.000000 0.000000 1.000000 0.000000

"""
LEFT = CAMERA.format(side="left", projection="311.000000 0.000000")
RIGHT = CAMERA.format(side="right", projection="341.000000 -60.000000")


def saved(folder: Path, *texts: str) -> list[Path]:
    files = [folder / f"{place}.ini" for place, _ in enumerate(texts)]
    for file, text in zip(files, texts, strict=True):
        file.write_text(text)
    return files


@pytest.mark.parametrize(
    "texts",
    [
        pytest.param((LEFT, RIGHT), id="a file for each camera"),
        pytest.param((LEFT + RIGHT,), id="ost.txt, which holds both"),
        pytest.param((LEFT.replace("\n", "\r\n"), RIGHT.replace("\n", "\r\n")), id="lines as Windows ends them"),
    ],
)
def test_both_cameras_are_read_in_metres(tmp_path: Path, texts: tuple[str, ...]) -> None:
    found = read_cameras(saved(tmp_path, *texts))
    assert (found.calibration, found.size) == (Calibration(500, 120, 30, (311, 250)), (480, 640))


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        pytest.param((LEFT,), "1 camera of ROS: give the left and the right one", id="one alone"),
        pytest.param((LEFT, RIGHT + RIGHT), "3 cameras of ROS", id="three"),
        pytest.param((RIGHT, LEFT), "exchange the two views", id="exchanged"),
        pytest.param((LEFT, RIGHT[: RIGHT.index("projection")]), "no matrix of 3 x 4", id="cut off"),
        pytest.param((LEFT.replace("640", "6e2"), RIGHT), "image_width is '6e2'", id="no whole number"),
    ],
)
def test_what_is_no_pair_is_one_line(tmp_path: Path, texts: tuple[str, ...], message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        read_cameras(saved(tmp_path, *texts))
