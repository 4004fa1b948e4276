"""KITTI's published numbers, in the layouts of its benchmarks."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from semidense.datasets import CalibrationError, open_dataset
from semidense.datasets.formats.calibration.cameras import PairCalibration
from semidense.datasets.formats.calibration.reading import read_cameras

P = {
    0: "7.215377e+02 0 6.095593e+02 0 0 7.215377e+02 1.728540e+02 0 0 0 1 0",
    1: "7.215377e+02 0 6.095593e+02 -3.875744e+02 0 7.215377e+02 1.728540e+02 0 0 0 1 0",
    2: "7.215377e+02 0 6.095593e+02 4.485728e+01 0 7.215377e+02 1.728540e+02 2.163791e-01 0 0 1 2.745884e-03",
    3: "7.215377e+02 0 6.095593e+02 -3.395242e+02 0 7.215377e+02 1.728540e+02 2.199936e+00 0 0 1 2.729905e-03",
}
GRAY = 1000 * 387.5744 / 721.5377
COLOUR = 1000 * (44.85728 + 339.5242) / 721.5377
BENCHMARK = "".join(f"P{number}: {row}\n" for number, row in P.items()) + "R0_rect: 1 0 0 0 1 0 0 0 1\n"
RAW = "calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.950000e-02\n" + "".join(
    f"S_0{number}: 1.392000e+03 5.120000e+02\nS_rect_0{number}: 1.242000e+03 3.750000e+02\nP_rect_0{number}: {row}\n"
    for number, row in P.items()
)


def read(folder: Path, text: str, of: str | None = None) -> PairCalibration:
    (folder / "c.txt").write_text(text)
    return read_cameras([folder / "c.txt"], folder=of)


@pytest.mark.parametrize("text", [BENCHMARK, RAW], ids=["benchmark", "raw"])
@pytest.mark.parametrize(
    ("folder", "baseline", "warned"),
    [("image_0", GRAY, 0), ("image_2", COLOUR, 0), ("image_02", COLOUR, 0), ("photos", COLOUR, 1)],
)
def test_the_cameras_are_those_of_the_folder(
    tmp_path: Path, text: str, folder: str, baseline: float, warned: int
) -> None:
    found = read(tmp_path, text, folder)
    assert found.calibration.baseline == pytest.approx(baseline, rel=1e-6)
    assert (found.calibration.focal, found.calibration.doffs) == (721.5377, 0)
    assert found.size == ((375, 1242) if text == RAW else None)
    assert len(found.warnings) == warned
    assert all("0.53273" in warning and "0.53715" in warning for warning in found.warnings)


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda text: text.replace("\n", "\r\n"), id="lines as Windows ends them"),
        pytest.param(lambda text: text.replace("\n", "  # px\n"), id="comments"),
        pytest.param(lambda text: text.replace("P", "  P").replace(":", " :"), id="spaces"),
        pytest.param(lambda text: text.replace(" ", ", ").replace(":,", ":"), id="commas"),
    ],
)
def test_how_lines_are_written_does_not_matter(tmp_path: Path, change: Callable[[str], str]) -> None:
    (tmp_path / "c.txt").write_text(change(f"P2: {P[2]}\nP3: {P[3]}\n"), newline="")
    assert read_cameras([tmp_path / "c.txt"]).calibration.baseline == pytest.approx(COLOUR, rel=1e-6)


@pytest.mark.parametrize(("folder", "baseline"), [("image_00", GRAY), ("image_02", COLOUR)])
def test_the_raw_data_keeps_its_images_one_folder_below(
    tmp_path: Path, save_image: Callable[..., Path], folder: str, baseline: float
) -> None:
    view = save_image(tmp_path / folder / "data" / "0.png", np.zeros((375, 1242), np.uint8))
    (tmp_path / "c.txt").write_text(RAW)
    (scene,) = open_dataset(f"pair:{view},{view},calib={tmp_path}/c.txt").scenes
    assert scene.calibration is not None
    assert scene.calibration.baseline == pytest.approx(baseline, rel=1e-6)
    assert scene.warnings == ()


def test_two_cameras_are_enough(tmp_path: Path) -> None:
    assert read(tmp_path, f"P2: {P[2]}\nP3: {P[3]}\n").calibration.baseline == pytest.approx(COLOUR, rel=1e-6)
    assert read(tmp_path, f"P1: {P[0]}\nP2: {P[1]}\n").calibration.baseline == pytest.approx(GRAY, rel=1e-6)


@pytest.mark.parametrize(
    ("text", "folder", "message"),
    [
        pytest.param(BENCHMARK.replace("P2: 7.2", "P2: nan 7.2"), "image_2", "P2 is no matrix", id="no number"),
        pytest.param(BENCHMARK.replace("P2: 7", "P2: x7"), "photos", "P2 is no matrix", id="a word"),
        pytest.param(f"P0: {P[0]}\nP1: {P[1]}\n", "image_2", "P0 and P1, but .* camera 2; .* P2 and P3", id="gray"),
        pytest.param(f"P2: {P[2]}\nP3: {P[3]}\n", "image_00/data", "P2 and P3, but .* camera 0", id="colour"),
        pytest.param(f"roi: 0 x 0 371\nP1_roi: {P[0]}\nP2_roi: {P[1]}\n", None, "roi is no matrix", id="roi"),
        pytest.param(BENCHMARK + f"P2: {P[0]}\n", "image_2", "P2 is given twice", id="twice"),
    ],
)
def test_no_line_is_passed_over_and_no_other_camera_taken(
    tmp_path: Path, text: str, folder: str | None, message: str
) -> None:
    with pytest.raises(CalibrationError, match=message):
        read(tmp_path, text, folder)


def test_cameras_without_a_number_are_of_any_folder(tmp_path: Path) -> None:
    assert read(tmp_path, f"P1_roi: {P[0]}\nP2_roi: {P[1]}\n", "image_0").calibration.focal == 721.5377


@pytest.mark.parametrize(
    ("text", "message"),
    [
        pytest.param(f"P2: {P[2]}\n", "no two cameras; expected P2 and P3", id="one camera"),
        pytest.param(f"P2: {P[2]}\nP3: 1 2 3\n", "P3 is no matrix of 3 x 4", id="cut off"),
    ],
)
def test_a_bad_file_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        read(tmp_path, text)


def test_the_street_of_karlsruhe(stereo_data: Path) -> None:
    folder = stereo_data / "own" / "karlsruhe_2010_03_09_drive_0023_000060"
    (scene,) = open_dataset(f"pair:{folder}/left.png,{folder}/right.png,calib={folder}/calib.txt").scenes
    known = scene.calibration
    assert known is not None
    assert (known.focal, known.doffs, known.centre) == (645.2401, 0, (635.9587, 194.1291))
    assert known.baseline == pytest.approx(1000 * 368.2632 / 645.2401)
    assert (scene.size, scene.warnings) == ((372, 1344), ())


@pytest.mark.parametrize(
    "text",
    [
        RAW.replace("1.242000e+03 3.750000e+02", "0 0"),
        f"roi: 5 4 0 9\nP1_roi: {P[0]}\nP2_roi: {P[1]}\n",
    ],
    ids=["S_rect", "roi"],
)
def test_images_without_a_pixel_are_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(CalibrationError, match="expected whole numbers of pixels"):
        read(tmp_path, text, "image_2")
