"""OpenCV's files and JSON: f 500 px, baseline 120 mm, centres 311 and 341."""

import itertools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from semidense.datasets import Calibration, CalibrationError
from semidense.datasets.formats.calibration.reading import read_cameras
from semidense.stages.disparity import depth as geometry

P1 = [[500.0, 0, 311, 0], [0, 500, 250, 0], [0, 0, 1, 0]]
P2 = [[500.0, 0, 341, -60], [0, 500, 250, 0], [0, 0, 1, 0]]
SIMPLE = {"fx": 500, "fy": 500, "cx": 311, "cy": 250, "baseline": 0.12}
LEFT = {"fx": 500, "fy": 500, "cx": 311, "cy": 250}


def saved(folder: Path, values: Any) -> Path:  # noqa: ANN401
    path = folder / "c.json"
    path.write_text(json.dumps(values))
    return path


@pytest.mark.parametrize(
    ("values", "doffs", "size"),
    [
        pytest.param({"P1": P1, "P2": P2}, 30, None, id="nested rows"),
        pytest.param({"p1": np.ravel(P1).tolist(), "p2": np.ravel(P2).tolist()}, 30, None, id="flat, small letters"),
        pytest.param({"P1": P1, "P2": P2, "image_width": 640, "image_height": 480}, 30, (480, 640), id="a size"),
        pytest.param({"P1": P1, "P2": P2, "imageSize": [640, 480]}, 30, (480, 640), id="a cv::Size"),
        pytest.param({**SIMPLE, "doffs": 30, "width": 640, "height": 480}, 30, (480, 640), id="numbers"),
        pytest.param({"K": [[500, 0, 311], [0, 500, 250], [0, 0, 1]], "baseline": 0.12}, 0, None, id="K"),
        pytest.param({"left": LEFT, "right": {**LEFT, "cx": 341}, "baseline": 0.12}, 30, None, id="two cameras"),
        pytest.param(
            {"left": LEFT, "right": {**LEFT, "cx": 341}, "baseline": 0.12, "doffs": 30}, 30, None, id="doffs twice"
        ),
        pytest.param(
            {"left": {**LEFT, "width": 640, "height": 480}, "right": LEFT, "baseline": 0.12},
            0,
            (480, 640),
            id="a size of the left camera",
        ),
        pytest.param({**SIMPLE, "resolution": [640, 480]}, 0, (480, 640), id="a resolution"),
        pytest.param({**SIMPLE, "image_shape": [480, 640]}, 0, (480, 640), id="a shape of NumPy's"),
        pytest.param({**SIMPLE, "image_size": {"width": 640, "height": 480}}, 0, (480, 640), id="a size with names"),
        pytest.param({"fx": 500, "ppx": 311, "ppy": 250, "baseline": 0.12}, 0, None, id="RealSense's names"),
        pytest.param(
            {"intrinsic": {"fx": 500, "fy": 500, "u0": 311, "v0": 250}, "extrinsic": {"baseline": 0.12, "x": 1.7}},
            0,
            None,
            id="Cityscapes",
        ),
    ],
)
def test_json(tmp_path: Path, values: dict[str, object], doffs: float, size: tuple[int, int] | None) -> None:
    found = read_cameras([saved(tmp_path, values)], "m")
    assert replace(found.calibration, baseline=120) == Calibration(500, 120, doffs, (311, 250))
    assert found.calibration.baseline == pytest.approx(120)
    assert found.size == size
    assert read_cameras([saved(tmp_path, {**values, "unit": "m"})]) == found


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("fx: 500\nfy: 500\ncx: 311\ncy: 250\ndoffs: 30\nbaseline: 0.12\nunit: m\n", id="numbers"),
        pytest.param(f"---\nP1: {P1}\nP2: {P2}\nunit: m\n", id="matrices"),
    ],
)
def test_yaml_of_ones_own(tmp_path: Path, text: str) -> None:
    (tmp_path / "c.yaml").write_text(text)
    known = read_cameras([tmp_path / "c.yaml"]).calibration
    assert replace(known, baseline=120) == Calibration(500, 120, 30, (311, 250))
    assert known.baseline == pytest.approx(120)


@pytest.mark.parametrize("word", ["m", "M", "meters", "Metre"])
def test_a_unit_may_be_written_out(tmp_path: Path, word: str) -> None:
    assert read_cameras([saved(tmp_path, {**SIMPLE, "unit": word})]).calibration.baseline == pytest.approx(120)


def test_a_doffs_that_contradicts_two_cameras_is_told(tmp_path: Path) -> None:
    values = {"left": LEFT, "right": {**LEFT, "cx": 341}, "baseline": 0.12, "doffs": 3, "unit": "m"}
    found = read_cameras([saved(tmp_path, values)])
    assert found.calibration.doffs == 3
    assert "doffs is 3, but the right cx minus the left one is 30" in found.warnings[0]


def test_toml_of_ones_own(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text('fx = 500\ncx = 311\ncy = 250\nbaseline = 12\ndoffs = 30\nunit = "cm"\n')
    assert read_cameras([tmp_path / "c.toml"]).calibration == Calibration(500, 120, 30, (311, 250))
    (tmp_path / "c.toml").write_text("fx = 500\ncx =\n")
    with pytest.raises(CalibrationError, match="no valid TOML"):
        read_cameras([tmp_path / "c.toml"])


def test_json_of_opencv(tmp_path: Path) -> None:
    storage = cv2.FileStorage(str(tmp_path / "c.json"), cv2.FILE_STORAGE_WRITE)
    storage.write("P1", np.array(P1))
    storage.write("P2", np.array(P2))
    storage.release()
    assert read_cameras([tmp_path / "c.json"], "m").calibration == Calibration(500, 120, 30, (311, 250))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        pytest.param({"P1": P1, "P2": P2}, "does not tell its unit of length; give unit", id="no unit"),
        pytest.param({"baseline": 1, "fx": 2, "unit": "m"}, "no cx; expected fx, fy, cx and cy", id="no centre"),
        pytest.param({"K": [1, 2], "baseline": 1, "unit": "m"}, "K is no matrix of 3 x 3", id="half a matrix"),
        pytest.param({**SIMPLE, "fx": "wide", "unit": "m"}, "fx is no matrix of 1 x 1", id="a word"),
        pytest.param({**SIMPLE, "fx": True, "unit": "m"}, "fx is no matrix of 1 x 1", id="true is no number"),
        pytest.param({**SIMPLE, "unit": "inch"}, "unit 'inch' of length is not known; give unit mm", id="inches"),
        pytest.param(
            {"K": [500, 0, 0, 0, 500, 0, 311, 250, 1], "baseline": 1, "unit": "m"}, "is it transposed", id="MATLAB's K"
        ),
        pytest.param(
            {"P1": P1, "P2": np.array(P1).T.tolist(), "unit": "m"}, "focal lengths|transposed", id="P2 turned"
        ),
        pytest.param({"M1": 1, "R": 1, "T": 1}, "not rectified; rectify the pair with it first", id="unrectified"),
        pytest.param({"R": 1}, "Known are: Middlebury", id="the list of what is read"),
        pytest.param({"R": 1}, "neither P1 and P2 nor Q, nor a camera matrix and a baseline", id="something else"),
    ],
)
def test_bad_json_is_one_line(tmp_path: Path, values: object, message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        read_cameras([saved(tmp_path, values)])


def q(*, fy: float = 500, flip: float = 1) -> np.ndarray:
    return np.array(
        [[1.0, 0, 0, -311], [0, flip * 500 / fy, 0, -flip * 500 / fy * 250], [0, 0, 0, flip * 500], [0, 0, 25 / 3, 250]]
    )


@pytest.mark.parametrize(
    "matrix",
    [
        pytest.param(q(), id="as stereoRectify gives it"),
        pytest.param(3 * q(), id="three times as much is the same"),
        pytest.param(q(fy=400), id="another focal length along y"),
        pytest.param(q(flip=-1), id="y up, as in OpenCV's sample"),
    ],
)
def test_q_places_points_where_opencv_does(tmp_path: Path, matrix: np.ndarray) -> None:
    disparity = np.linspace(5, 60, 12, dtype=np.float32).reshape(3, 4)
    expected = cv2.reprojectImageTo3D(disparity, matrix.astype(np.float32)).reshape(-1, 3)
    known = read_cameras([saved(tmp_path, {"Q": matrix.tolist()})], "m").calibration
    z = geometry.depth(disparity, known.focal, known.baseline / 1000, known.doffs)
    placed = geometry.points(z, known.focal, known.centre, known.focal_y)
    turned = [1, -1, -1] if matrix[2, 3] > 0 else [1, 1, 1]
    assert np.allclose(placed, expected * turned, rtol=1e-4)


@pytest.mark.parametrize(("row", "column"), [(0, 1), (2, 0), (1, 2)])
def test_a_q_of_another_kind_is_refused(tmp_path: Path, row: int, column: int) -> None:
    matrix = q()
    matrix[row, column] = 0.5
    with pytest.raises(CalibrationError, match=r"Q is not what cv2\.stereoRectify gives; give P1 and P2"):
        read_cameras([saved(tmp_path, {"Q": matrix.tolist()})], "m")


def test_a_real_rectification_gives_the_depth_that_opencv_gives(tmp_path: Path) -> None:
    """``stereoRectify`` of two turned cameras; its P1 and P2, and its Q, must place points as OpenCV does."""
    camera = np.array([[420.0, 0, 322], [0, 415, 236], [0, 0, 1]])
    turn, _ = cv2.Rodrigues(np.array([0.01, -0.02, 0.015]))
    offset = np.array([[-0.11], [0.004], [0.003]])
    found = cv2.stereoRectify(camera, np.zeros(5), camera, np.zeros(5), (640, 480), turn, offset, flags=0)
    first, second, matrix = found[2:5]
    disparity = np.full((1, 1), 25, np.float32)
    expected = cv2.reprojectImageTo3D(disparity, matrix.astype(np.float32))[0, 0]
    for values in ({"P1": first.tolist(), "P2": second.tolist()}, {"Q": matrix.tolist()}):
        known = read_cameras([saved(tmp_path, values)], "m").calibration
        z = geometry.depth(disparity, known.focal, known.baseline / 1000, known.doffs)
        assert np.allclose(geometry.points(z, known.focal, known.centre)[0] * [1, -1, -1], expected, rtol=1e-4)


@pytest.mark.parametrize("size", [[0, 0], [640.7, 480], [-4, 5]])
def test_a_size_that_no_image_has_is_refused(tmp_path: Path, size: list[float]) -> None:
    with pytest.raises(CalibrationError, match=r"the image's size is .* expected whole numbers of pixels"):
        read_cameras([saved(tmp_path, SIMPLE | {"unit": "m", "width": size[0], "height": size[1]})])


@pytest.mark.parametrize("last", ["P1: *p\nP2: *p", "fx: 1\nunit: *p", "image_size: *p", "nothing: 1"])
def test_lists_that_hold_each_other_are_not_walked_to_their_end(tmp_path: Path, last: str) -> None:
    names = "abcdefghijklmnop"
    lines = [f"a: &a [{', '.join(['1'] * 9)}]"]
    lines += [f"{new}: &{new} [{', '.join(['*' + old] * 9)}]" for old, new in itertools.pairwise(names)]
    (tmp_path / "c.yml").write_text("%YAML:1.0\n---\n" + "\n".join([*lines, last]))
    with pytest.raises(CalibrationError, match="aliases stand for more than 262,144 values"):
        read_cameras([tmp_path / "c.yml"], "m")


def test_an_alias_is_read_as_what_it_stands_for(tmp_path: Path) -> None:
    (tmp_path / "c.yml").write_text(f"%YAML:1.0\n---\nP1: &left {P1}\nP2: {P2}\nagain: *left\n")
    assert read_cameras([tmp_path / "c.yml"], "mm").calibration.baseline == pytest.approx(0.12)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        pytest.param("c.yml", "%YAML:1.0\n---\ndate: 2020-13-45\n", id="an impossible date"),
        pytest.param("c.json", f'{{"fx": {"9" * 5000}}}', id="JSON with too many digits"),
        pytest.param("c.yml", f"%YAML:1.0\n---\nfx: {'9' * 5000}\n", id="YAML with too many digits"),
    ],
)
def test_a_value_that_cannot_be_is_one_line(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(CalibrationError, match=r"no valid (YAML|JSON)"):
        read_cameras([tmp_path / name])
