"""Read the calibration of a rectified pair in the files that people have.

- Middlebury's ``calib.txt``, in millimetres; see `semidense.datasets.formats.calib`;
- an OpenCV ``FileStorage``, YAML or XML, with ``P1`` and ``P2``, or ``Q``, as ``cv2.stereoRectify`` gives them; its
  unit is that of the calibration board's squares, which the file does not tell;
- a pair of ROS ``CameraInfo`` files, left and right: what ``camera_calibration`` writes, or a message as YAML, in
  metres.

The two cameras' projection matrices are ``[f 0 cx 0; 0 f cy 0; 0 0 1 0]`` and ``[f 0 cx' Tx; 0 f cy 0; 0 0 1 0]`` with
``Tx = -f * baseline``; ``Q`` holds ``f``, ``cx``, ``cy``, ``-1/T`` and ``(cx - cx')/T`` with ``T = -baseline``.
Sources: OpenCV's ``calib3d`` module; ROS message ``sensor_msgs/CameraInfo``, http://wiki.ros.org/image_pipeline/CameraInfo.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from semidense.datasets.errors import CalibrationError, MissingFileError
from semidense.datasets.formats.calib import read_calib
from semidense.datasets.scene import Calibration

MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0}
"""Millimetres of each unit that a calibration may be in."""
_LARGEST_FILE = 1 << 18
_Matrix: TypeAlias = NDArray[np.float64]
_SAME = 1e-6
_VERTICAL = "the cameras stand one above the other; only a pair side by side can be matched"


@dataclass(frozen=True)
class PairCalibration:
    """Hold what is known of a rectified pair.

    Attributes:
        calibration: Focal length and principal point of the left camera, baseline in millimetres, ``doffs``.
        size: Rows and columns of the images, None if the file does not tell.
        ndisp: Number of disparities to search from 0 on, None if the file does not tell.
    """

    calibration: Calibration
    size: tuple[int, int] | None = None
    ndisp: int | None = None


def read_cameras(files: Sequence[Path], unit: str | None = None) -> PairCalibration:
    """Read the calibration of a pair from one file, or from a left and a right one.

    Args:
        files: A ``calib.txt``, an OpenCV file, or two ROS files.
        unit: ``mm``, ``cm`` or ``m``; needed for OpenCV's files, which do not tell; elsewhere instead of the usual one.

    Raises:
        MissingFileError: If there is no such file.
        CalibrationError: If a file is not valid, no unit is known, or the cameras are no rectified pair side by side.
    """
    if unit is not None and unit not in MILLIMETRES:
        raise CalibrationError(f"unit {unit!r} of a calibration; give {', '.join(MILLIMETRES)}")
    if len(files) == 2:
        return _ros_pair(files[0], files[1], MILLIMETRES[unit or "m"])
    if len(files) != 1:
        raise CalibrationError(f"{len(files)} calibration files; give one, or a left and a right one")
    text = _text(files[0])
    if not text.lstrip().startswith(("%YAML", "<?xml", "<opencv_storage")):
        return _middlebury(files[0], MILLIMETRES[unit or "mm"])
    if unit is None:
        raise CalibrationError(f"{files[0]}: an OpenCV file does not tell its unit of length; give unit mm, cm or m")
    return _opencv(files[0], text, MILLIMETRES[unit])


def _middlebury(path: Path, scale: float) -> PairCalibration:
    found = read_calib(path)
    given = found.calibration
    return PairCalibration(
        Calibration(given.focal, given.baseline * scale, given.doffs, given.centre), found.size, found.ndisp
    )


def _opencv(path: Path, text: str, scale: float) -> PairCalibration:
    found = _opencv_yaml(path, text) if text.lstrip().startswith("%YAML") else _opencv_xml(path, text)
    if {"P1", "P2"} <= found.keys():
        calibration = _from_projections(path, _shaped(path, found, "P1", (3, 4)), _shaped(path, found, "P2", (3, 4)))
    elif "Q" in found:
        calibration = _from_q(path, _shaped(path, found, "Q", (4, 4)))
    else:
        raise CalibrationError(f"{path}: neither P1 and P2 nor Q; save what cv2.stereoRectify gives")
    return PairCalibration(_scaled(calibration, scale))


def _ros_pair(left: Path, right: Path, scale: float) -> PairCalibration:
    infos = [_mapping(path, _yaml(path, _text(path))) for path in (left, right)]
    projections = [_ros_projection(path, info) for path, info in zip((left, right), infos, strict=True)]
    sizes = [
        (info.get("image_height", info.get("height")), info.get("image_width", info.get("width"))) for info in infos
    ]
    if sizes[0] != sizes[1]:
        raise CalibrationError(f"{right}: image of {sizes[1]}, but {left} is of {sizes[0]} (rows, columns)")
    calibration = _scaled(_from_projections(right, *projections), scale)
    rows, columns = sizes[0]
    return PairCalibration(calibration, (rows, columns) if rows and columns else None)


def _ros_projection(path: Path, info: Mapping[str, Any]) -> _Matrix:
    found = info.get("projection_matrix", info.get("P", info.get("p")))
    data = found.get("data") if isinstance(found, dict) else found
    return _matrix(path, "projection_matrix (or P)", data, (3, 4))


def _from_projections(path: Path, left: _Matrix, right: _Matrix) -> Calibration:
    """Read a calibration off two projection matrices, in the unit of the right one's translation."""
    focal, shift = float(right[0, 0]), float(right[0, 3])
    if focal <= 0 or abs(left[0, 0] - focal) > _SAME * abs(focal):
        raise CalibrationError(
            f"{path}: focal lengths {left[0, 0]:g} and {focal:g}; a rectified pair shares one above 0"
        )
    if abs(right[1, 3]) > abs(shift):
        raise CalibrationError(f"{path}: {_VERTICAL}")
    if shift >= 0:
        raise CalibrationError(f"{path}: the right camera stands {shift / focal:g} to the left; exchange the two views")
    centre = (float(left[0, 2]), float(left[1, 2]))
    return Calibration(focal, -shift / focal, float(right[0, 2]) - centre[0], centre)


def _from_q(path: Path, q: _Matrix) -> Calibration:
    if q[3, 2] == 0 or not np.allclose(q[3, :2], 0):
        raise CalibrationError(f"{path}: Q has no baseline; {_VERTICAL}")
    baseline = float(1 / q[3, 2])
    if baseline < 0:
        raise CalibrationError(f"{path}: the right camera stands {-baseline:g} to the left; exchange the two views")
    return Calibration(float(q[2, 3]), baseline, float(q[3, 3]) * baseline, (-float(q[0, 3]), -float(q[1, 3])))


def _scaled(calibration: Calibration, scale: float) -> Calibration:
    return Calibration(calibration.focal, calibration.baseline * scale, calibration.doffs, calibration.centre)


def _shaped(path: Path, found: Mapping[str, Any], name: str, shape: tuple[int, int]) -> _Matrix:
    return _matrix(path, name, found[name], shape)


def _matrix(path: Path, name: str, data: object, shape: tuple[int, int]) -> _Matrix:
    try:
        values = np.array(data, np.float64)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.size != math.prod(shape) or not np.isfinite(values).all():
        raise CalibrationError(f"{path}: {name} is no matrix of {shape[0]} x {shape[1]} numbers")
    return values.reshape(shape)


def _opencv_xml(path: Path, text: str) -> dict[str, Any]:
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise CalibrationError(f"{path}: damaged XML ({error})") from error
    return {element.tag: (element.findtext("data") or "").split() for element in root}


def _opencv_yaml(path: Path, text: str) -> dict[str, Any]:
    # OpenCV writes a directive that YAML does not know, and tags its matrices.
    plain = text.split("\n", 1)[1] if "\n" in text else ""
    found = _mapping(path, _yaml(path, plain.replace("!!opencv-matrix", "")))
    return {name: value.get("data") if isinstance(value, dict) else value for name, value in found.items()}


def _mapping(path: Path, found: object) -> dict[str, Any]:
    if not isinstance(found, dict):
        raise CalibrationError(f"{path}: no names and values; expected a calibration")
    return found


def _yaml(path: Path, text: str) -> object:
    import yaml  # Dask brings it

    try:
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise CalibrationError(f"{path}: no valid YAML ({' '.join(str(error).split())[:120]})") from error


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST_FILE + 1)
    except OSError as error:
        raise MissingFileError(f"{path}: cannot be read ({error.strerror})") from error
    if len(content) > _LARGEST_FILE:
        raise CalibrationError(f"{path}: more than {_LARGEST_FILE:,} bytes; the file is no calibration")
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        raise CalibrationError(f"{path}: no plain text; the file is no calibration") from error
