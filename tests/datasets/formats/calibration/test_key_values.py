from dataclasses import replace
from pathlib import Path

import pytest

from semidense.datasets import Calibration, CalibrationError, open_dataset
from semidense.datasets.formats.calibration.reading import read_cameras

TEXT = (
    "# a sensor\ncamera.A=[600 0 320; 0 600 240; 0 0 1]  # K\ncamera.height=480\ncamera.width=640\nt=0.1\nrho={rho}\n"
)


@pytest.mark.parametrize(("rho", "warned"), [(60, False), (75, True)])
def test_a_sensors_parameters(tmp_path: Path, rho: float, warned: bool) -> None:
    (tmp_path / "c.txt").write_text(TEXT.format(rho=rho))
    found = read_cameras([tmp_path / "c.txt"])
    assert found.calibration.baseline == pytest.approx(100)
    assert replace(found.calibration, baseline=100) == Calibration(600, 100, 0, (320, 240))
    assert found.size == (480, 640)
    assert [("75" in warning and "60" in warning) for warning in found.warnings] == [True] * warned


def test_a_missing_line_is_named(tmp_path: Path) -> None:
    (tmp_path / "c.txt").write_text("camera.A=[600 0 320; 0 600 240; 0 0 1]\n")
    with pytest.raises(CalibrationError, match=r"no line t=\.\.\.; expected the baseline in metres"):
        read_cameras([tmp_path / "c.txt"])


def test_the_cup_on_the_table(stereo_data: Path) -> None:
    folder = stereo_data / "own" / "rccube_cup_blocking_dustpan"
    spec = f"pair:{folder}/left.png,{folder}/right.png,calib={folder}/camera_parameters.txt"
    (scene,) = open_dataset(spec).scenes
    assert scene.calibration is not None
    assert scene.calibration.baseline == pytest.approx(160.05)
    assert replace(scene.calibration, baseline=160) == Calibration(1104.37, 160, 0, (640, 480))
    assert (scene.size, scene.warnings) == ((960, 1280), ())
