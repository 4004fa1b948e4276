"""What two projection matrices mean: judged by projecting known points, and by OpenCV."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from semidense.datasets import Calibration, CalibrationError
from semidense.datasets.formats.calibration.cameras import Cameras, PairCalibration, calibrated
from semidense.stages.disparity import depth as geometry

LEFT = np.array([[360.0, 0, 112, 0], [0, 360, 93, 0], [0, 0, 1, 0]])


def camera(**entries: float) -> np.ndarray:
    """A projection matrix with some entries replaced: fx, skew, cx, tx, fy, cy, ty."""
    places = {"fx": (0, 0), "skew": (0, 1), "cx": (0, 2), "tx": (0, 3), "fy": (1, 1), "cy": (1, 2), "ty": (1, 3)}
    matrix = LEFT.copy()
    for name, value in entries.items():
        matrix[places[name]] = value
    return matrix


def pair(left: np.ndarray, right: np.ndarray, **more: object) -> PairCalibration:
    return calibrated(Cameras(Path("c.yml"), left, right, "m", **more))


def test_the_left_cameras_place_counts() -> None:
    assert pair(camera(tx=21.6), camera(tx=-36)).calibration.baseline == pytest.approx(160)
    assert pair(camera(), camera(tx=-36)).calibration.baseline == pytest.approx(100)


def test_two_cameras_in_one_place_are_refused() -> None:
    with pytest.raises(CalibrationError, match="stand in one place"):
        pair(camera(tx=-57.6), camera(tx=-57.6))


@pytest.mark.parametrize(
    ("left", "right"),
    [
        pytest.param({}, {"tx": -36.0}, id="plain"),
        pytest.param({"tx": 21.6}, {"tx": -36.0}, id="a left camera beside the origin"),
        pytest.param({"fy": 270}, {"fy": 270, "tx": -36.0}, id="another focal length along y"),
        pytest.param({"skew": 7}, {"skew": 7, "tx": -36.0}, id="skew"),
        pytest.param({"cx": 100}, {"cx": 131.5, "tx": -36.0}, id="principal points apart"),
    ],
)
def test_points_come_back_where_they_were(left: dict[str, float], right: dict[str, float]) -> None:
    cameras = camera(**left), camera(**right)
    truth = np.array([[0.3, -0.2, 2.0], [-1.0, 0.8, 5.0], [0.1, 0.4, 1.5]])  # X, Y, Z of the origin, metres
    seen = [(matrix @ np.column_stack([truth, np.ones(3)]).T).T for matrix in cameras]
    pixels = [each[:, :2] / each[:, 2:] for each in seen]
    found = cv2.triangulatePoints(*cameras, *(each.T for each in pixels))
    assert np.allclose((found[:3] / found[3]).T, truth)

    known = pair(*cameras).calibration
    z = geometry.depth((pixels[0] - pixels[1])[:, 0], known.focal, known.baseline / 1000, known.doffs)
    assert np.allclose(z, truth[:, 2], rtol=1e-5)
    for (x, y), distance, point in zip(pixels[0], z, truth, strict=True):
        # The pixel is moved to column 0, row 0: a map of one pixel, whose principal point moves with it.
        centre = (known.centre[0] - x, known.centre[1] - y)
        one = np.array([[distance]], np.float32)
        placed = geometry.points(one, known.focal, centre, known.focal_y, known.skew)[0]
        of_left_camera = point + np.array([cameras[0][0, 3] / 360, 0, 0])
        assert np.allclose(placed, of_left_camera * [1, -1, -1], rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize(
    ("right", "more", "numbers"),
    [
        pytest.param({"cy": 95}, {}, ("93", "95"), id="rows that do not agree"),
        pytest.param({"fy": 300}, {}, ("360", "300"), id="scales that do not agree"),
        pytest.param({"skew": 2}, {}, ("0", "2"), id="skews that do not agree"),
        pytest.param({"cx": 120}, {"doffs": 5.0}, ("5", "8"), id="doffs that contradicts the centres"),
    ],
)
def test_what_contradicts_itself_is_said_with_both_numbers(
    right: dict[str, float], more: dict[str, object], numbers: tuple[str, str]
) -> None:
    (warning,) = pair(camera(), camera(tx=-36, **right), **more).warnings
    assert all(f" {number}" in warning for number in numbers)
    assert "\n" not in warning


def test_doffs_as_stated_counts() -> None:
    assert pair(camera(), camera(tx=-36, cx=120), doffs=5.0).calibration.doffs == 5
    assert pair(camera(), camera(tx=-36, cx=120.02), doffs=8.0).warnings == ()


def test_a_calibration_of_a_larger_picture_gives_the_same_depth() -> None:
    """Of 748 x 900 pixels, for pictures of 187 x 225: a quarter of everything, and no more than rounding in depth."""
    full = camera(fx=1440, fy=1440, cx=449.5, cy=373.5)
    known = pair(full, full + np.array([[0, 0, 12, -1440 * 0.16], [0] * 4, [0] * 4]), size=(748, 900), ndisp=70)
    found = known.fitted("pair", (187, 225))
    assert replace(found.calibration, baseline=160) == Calibration(360, 160, 3, (112, 93))
    assert found.calibration.baseline == pytest.approx(160)
    assert (found.size, found.ndisp) == ((187, 225), 18)
    assert "748 x 900" in found.warnings[0] and "187 x 225" in found.warnings[0]
    assert known.fitted("pair", (748, 900)).warnings == ()


def test_a_crop_is_refused() -> None:
    with pytest.raises(
        CalibrationError, match="pair: the calibration is of 748 x 900 pixels, the images have 187 x 200"
    ):
        pair(camera(), camera(tx=-36), size=(748, 900)).fitted("pair", (187, 200))


@pytest.mark.parametrize(("size", "warned"), [((187, 225), False), ((187, 112), True), ((93, 225), True)])
def test_a_principal_point_outside_the_image_is_said(size: tuple[int, int], warned: bool) -> None:
    found = pair(camera(), camera(tx=-36)).fitted("pair", size)
    assert [("outside the image" in warning) for warning in found.warnings] == [True] * warned
