"""Read the calibration of a rectified pair in whichever format a file is, told by its content."""

import re
from collections.abc import Sequence
from pathlib import Path

from semidense.datasets.errors import CalibrationError
from semidense.datasets.formats.calibration.cameras import MILLIMETRES, Cameras, PairCalibration, calibrated
from semidense.datasets.formats.calibration.intrinsics import intrinsics_cameras, numbers_only
from semidense.datasets.formats.calibration.key_values import key_value_cameras
from semidense.datasets.formats.calibration.kitti import is_kitti, kitti_cameras
from semidense.datasets.formats.calibration.markup import markup_values, yaml_values
from semidense.datasets.formats.calibration.matrices import matrices_cameras
from semidense.datasets.formats.calibration.middlebury import middlebury_cameras
from semidense.datasets.formats.calibration.ros import ros_cameras
from semidense.datasets.formats.calibration.text import named_lines, read_text

UNDERSTOOD = (
    "Middlebury's calib.txt (cam0=[...]); OpenCV's YAML, XML or JSON (P1 and P2, or Q); ROS's CameraInfo, a left and a "
    "right file; KITTI's (P2: ..., P_rect_02: ..., P1_roi: ...); a K.txt of nine numbers and the baseline in metres; "
    "JSON or YAML with fx, fy, cx, cy or K, and baseline; a stereo sensor's camera.A=[...] and t=..."
)
"""The formats, for messages."""


def read_cameras(files: Sequence[Path], unit: str | None = None, folder: str | None = None) -> PairCalibration:
    """Read the calibration of a pair from one file, or from a left and a right one.

    Args:
        files: One file, or the two of ROS.
        unit: ``mm``, ``cm`` or ``m``; needed where the file does not tell, elsewhere instead of its own.
        folder: Name of the left view's folder, which tells KITTI's gray cameras from the colour ones.

    Raises:
        MissingFileError: If there is no such file.
        CalibrationError: If a file is not valid, no unit is known, or the cameras are no rectified pair side by side.
    """
    if unit is not None and unit not in MILLIMETRES:
        raise CalibrationError(f"unit {unit!r} of a calibration; give {', '.join(MILLIMETRES)}")
    if len(files) == 2:
        return calibrated(ros_cameras(files[0], files[1]), unit)
    if len(files) != 1:
        raise CalibrationError(f"{len(files)} calibration files; give one, or a left and a right one")
    return calibrated(_single(files[0], read_text(files[0]), folder), unit)


def _single(path: Path, text: str, folder: str | None) -> Cameras:
    if text.lstrip().startswith(("<", "{", "%YAML")):
        return matrices_cameras(path, markup_values(path, text))
    return _plain(path, text, folder)


def _plain(path: Path, text: str, folder: str | None) -> Cameras:
    if is_kitti(text):
        return kitti_cameras(path, text, folder)
    if re.search(r"^\s*camera\.A\s*=", text, re.MULTILINE):
        return key_value_cameras(named_lines(path, text))
    if re.search(r"^\s*(cam[01]|doffs|ndisp)\s*=", text, re.MULTILINE):
        return middlebury_cameras(named_lines(path, text))
    if re.search(r"^(P1|Q|baseline)\s*:", text, re.MULTILINE | re.IGNORECASE):
        return matrices_cameras(path, yaml_values(path, text))
    if numbers := numbers_only(text):
        return intrinsics_cameras(path, numbers)
    raise CalibrationError(f"{path}: no known calibration format{_single_ros(text)}. Known are: {UNDERSTOOD}")


def _single_ros(text: str) -> str:
    alone = re.search(r"^\s*(projection_matrix|[Pp])\s*:", text, re.MULTILINE)
    return "; it looks like one of ROS's two files, give the other too" if alone else ""
