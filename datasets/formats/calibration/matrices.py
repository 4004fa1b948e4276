"""Read a calibration from named values: OpenCV's ``P1`` and ``P2``, or ``Q``, or a camera matrix and a baseline.

OpenCV's ``FileStorage`` (YAML, XML, JSON) holds them, and JSON or YAML that people write themselves::

    {"P1": [[...], ...], "P2": [[...], ...], "image_width": 640, "image_height": 480, "unit": "mm"}
    {"K": [[600, 0, 320], [0, 600, 240], [0, 0, 1]], "baseline": 0.12, "unit": "m"}
    {"fx": 600, "fy": 600, "cx": 320, "cy": 240, "baseline": 120, "unit": "mm"}
    {"left": {"fx": ...}, "right": {"fx": ...}, "baseline": 120, "unit": "mm"}
    {"intrinsic": {"fx": 2262.5, "fy": 2265.3, "u0": 1097, "v0": 513}, "extrinsic": {"baseline": 0.21}}   Cityscapes

Upper and lower case are the same. ``imageSize`` and ``resolution`` are columns and rows, as ``cv::Size`` is;
``image_shape`` is rows and columns, as NumPy's is. The unit of OpenCV's files is that of the calibration board's
squares, which they do not tell. With two cameras ``doffs`` repeats what they say; with one, it moves the right one's
``cx``.

``Q`` reprojects ``[x y d 1]``: up to a factor it holds 1, ``cx``, ``cy``, ``f``, ``1/baseline`` and ``doffs/baseline``.
Source: OpenCV's ``stereoRectify`` and ``reprojectImageTo3D``.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from semidense.datasets.errors import CalibrationError
from semidense.datasets.formats.calibration.cameras import VERTICAL, Cameras, unknown_format
from semidense.datasets.formats.calibration.markup import lower
from semidense.datasets.formats.calibration.text import Matrix, matrix, sides

_CAMERA = ("k", "camera_matrix", "cameramatrix", "intrinsics")
_SIDES = (("left", "right"), ("cam0", "cam1"), ("left_camera", "right_camera"))
_PARTS = ("intrinsic", "extrinsic")
_CENTRE = {"cx": ("cx", "ppx", "u0"), "cy": ("cy", "ppy", "v0")}
"""Names of the principal point's column and row: also those of RealSense and of Cityscapes."""
_WIDTH, _HEIGHT = ("image_width", "width", "w"), ("image_height", "height", "h")
_SIZES, _SHAPES = ("imagesize", "image_size", "resolution"), ("image_shape", "imageshape")
_UNRECTIFIED = ("m1", "k1", "cameramatrix1", "camera_matrix_1", "camera_matrix_left", "left_camera_matrix")
"""Names of the left camera matrix in files of ``cv2.stereoCalibrate``."""
_OF_Q = ((0, 0), (1, 1), (0, 3), (1, 3), (2, 3), (3, 2), (3, 3))
"""Entries of Q that may differ from 0."""


def matrices_cameras(path: Path, found: Mapping[str, Any]) -> Cameras:
    """Return what named values say.

    Raises:
        CalibrationError: If a matrix is not valid, or what depth needs is not there.
    """
    values = _flat(path, found)
    views = _views(path, values)
    left, right = _projections(path, values, views)
    unit = values.get("unit", values.get("units"))
    size = next((size for each in (values, *views) if (size := _whole_size(path, each))), None)
    doffs = _number(path, values, "doffs") if views and "doffs" in values else None
    return Cameras(path, left, right, None if unit is None else _word(unit), size, doffs=doffs)


def _word(value: object) -> str:
    """Return a text, also where XML gives it as a list of words."""
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


def _flat(path: Path, found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values with names in lower case; what Cityscapes keeps in two parts is put together."""
    values = lower(str(path), found)
    return lower(str(path), values, *(values[name] for name in _PARTS if isinstance(values.get(name), dict)))


def _views(path: Path, values: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the values of the left and the right camera where each has its own, else nothing."""
    sides = next((pair for pair in _SIDES if all(isinstance(values.get(name), dict) for name in pair)), ())
    return [lower(str(path), values[name]) for name in sides]


def _projections(path: Path, values: Mapping[str, Any], views: Sequence[Mapping[str, Any]]) -> tuple[Matrix, Matrix]:
    if {"p1", "p2"} <= values.keys():
        return _matrix(path, values, "p1", (3, 4)), _matrix(path, values, "p2", (3, 4))
    if "q" in values:
        return _from_q(path, _matrix(path, values, "q", (4, 4)))
    if "baseline" in values:
        return _from_baseline(path, values, views)
    if any(name in values for name in _UNRECTIFIED):
        raise CalibrationError(
            f"{path}: neither P1 and P2 nor Q: it is of cameras that are not rectified; rectify the pair with it first "
            "(pipeline rectify LEFT RIGHT --calib FILE)"
        )
    raise unknown_format(path, ": neither P1 and P2 nor Q, nor a camera matrix and a baseline")


def _from_q(path: Path, given: Matrix) -> tuple[Matrix, Matrix]:
    """Return the projections that reproject like Q; it may turn y and Z round, as that of OpenCV's sample does."""
    others = given.copy()
    others[tuple(zip(*_OF_Q, strict=True))] = 0
    q = given / (given[0, 0] or 1)
    if q[3, 2] == 0 or not np.allclose(others[3], 0):
        raise CalibrationError(f"{path}: Q has no baseline; {VERTICAL}")
    if not np.allclose(others, 0) or given[0, 0] == 0 or q[2, 3] * q[1, 1] <= 0:
        raise CalibrationError(f"{path}: Q is not what cv2.stereoRectify gives; give P1 and P2")
    focal, baseline = abs(q[2, 3]), 1 / q[3, 2]
    shared = np.array([[focal, 0, -q[0, 3]], [0, q[2, 3] / q[1, 1], -q[1, 3] / q[1, 1]], [0, 0, 1]])
    return _moved(shared, shared, baseline, q[3, 3] * baseline)


def _from_baseline(path: Path, values: Mapping[str, Any], views: Sequence[Mapping[str, Any]]) -> tuple[Matrix, Matrix]:
    left, right = (_intrinsics(path, view) for view in (views or (values, values)))
    doffs = 0.0 if views or "doffs" not in values else _number(path, values, "doffs")
    return _moved(left, right, _number(path, values, "baseline"), doffs)


def _moved(left: Matrix, right: Matrix, baseline: float, doffs: float) -> tuple[Matrix, Matrix]:
    """Return projections of two cameras side by side; the right one's ``cx`` is moved by ``doffs``."""
    last = np.array([-left[0, 0] * baseline, 0, 0])
    moved = right + np.array([[0, 0, doffs], [0, 0, 0], [0, 0, 0]])
    return np.column_stack([left, np.zeros(3)]), np.column_stack([moved, last])


def _intrinsics(path: Path, values: Mapping[str, Any]) -> Matrix:
    name = next((name for name in _CAMERA if name in values and "fx" not in values), None)
    if name:
        return _matrix(path, values, name, (3, 3))
    fx, cx, cy = (_number(path, values, key) for key in ("fx", _called(values, "cx"), _called(values, "cy")))
    fy = _number(path, values, "fy") if "fy" in values else fx
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def _called(values: Mapping[str, Any], name: str) -> str:
    """Return under which of its names a coordinate of the principal point is there."""
    return next((each for each in _CENTRE[name] if each in values), name)


def _matrix(path: Path, values: Mapping[str, Any], name: str, shape: tuple[int, int]) -> Matrix:
    return matrix(path, name.upper(), _numbers(values[name]), shape)


def _numbers(value: object) -> object:
    """Return the numbers of a matrix as OpenCV writes it, anything else as it is."""
    return value.get("data") if isinstance(value, dict) else value


def _number(path: Path, values: Mapping[str, Any], name: str) -> float:
    if name not in values:
        raise CalibrationError(f"{path}: no {name}; expected fx, fy, cx and cy or a camera matrix, and baseline")
    return float(matrix(path, name, values[name], (1, 1))[0, 0])


def _whole_size(path: Path, values: Mapping[str, Any]) -> tuple[int, int] | None:
    rows, columns = stored_size(path, values)
    return None if rows is None or columns is None else (rows, columns)


def stored_size(path: Path, values: Mapping[str, Any]) -> tuple[int | None, int | None]:
    """Return rows and columns of the images under one of their names, None for a side that is not told.

    Args:
        path: The file, for messages.
        values: Its values, names in lower case.

    Raises:
        CalibrationError: If a side is no whole number above 0.
    """
    width, height, size, shape = (
        next((values[name] for name in names if name in values), None) for names in (_WIDTH, _HEIGHT, _SIZES, _SHAPES)
    )
    if isinstance(size, dict) and "data" not in size:
        return stored_size(path, lower(str(path), size))
    told = "the image's size"
    if size is not None:
        columns, rows = sides(path, told, matrix(path, told, _numbers(size), (1, 2)))
        return rows, columns
    if shape is not None and (width is None or height is None):
        return sides(path, told, matrix(path, told, _numbers(shape), (1, 2)))
    given = [1 if side is None else side for side in (height, width)]
    rows, columns = sides(path, told, matrix(path, told, given, (1, 2)))
    return None if height is None else rows, None if width is None else columns
