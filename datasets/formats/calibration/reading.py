"""Read the calibration of a rectified pair in whichever format a file is, told by its content."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from semidense.datasets.errors import CalibrationError
from semidense.datasets.formats.calibration.cameras import (
    Cameras,
    PairCalibration,
    calibrated,
    require_unit,
    unknown_format,
)
from semidense.datasets.formats.calibration.ini import ini_values, is_ini
from semidense.datasets.formats.calibration.intrinsics import intrinsics_cameras, numbers_only
from semidense.datasets.formats.calibration.key_values import key_value_cameras
from semidense.datasets.formats.calibration.kitti import is_kitti, kitti_cameras
from semidense.datasets.formats.calibration.markup import lower, markup_values, toml_values, yaml_values
from semidense.datasets.formats.calibration.matrices import matrices_cameras
from semidense.datasets.formats.calibration.middlebury import middlebury_cameras
from semidense.datasets.formats.calibration.ros import has_projection, ros_cameras
from semidense.datasets.formats.calibration.text import named_lines, read_text


def read_cameras(files: Sequence[Path], unit: str | None = None, folder: str | None = None) -> PairCalibration:
    """Read the calibration of a pair from one file, or from a left and a right one.

    Args:
        files: One file; or the left and the right one of ROS, or OpenCV's intrinsics and extrinsics.
        unit: ``mm``, ``cm`` or ``m``; needed where the file does not tell, elsewhere instead of its own.
        folder: Path of the left view's folder, which tells KITTI's gray cameras from the colour ones.

    Raises:
        MissingFileError: If there is no such file.
        CalibrationError: If a file is not valid, two files contradict each other, no unit is known, or the cameras are
            no rectified pair side by side.
    """
    require_unit(unit)
    if len(files) not in (1, 2):
        raise CalibrationError(f"{len(files)} calibration files; give one, or a left and a right one")
    texts = [read_text(path) for path in files]
    if len(files) == 1 and not is_ini(texts[0]):
        return calibrated(_single(files[0], texts[0], folder), unit)
    return calibrated(_two_parts(files, texts), unit)


def _two_parts(files: Sequence[Path], texts: Sequence[str]) -> Cameras:
    """Return what the two cameras of ROS say, or OpenCV's intrinsics and extrinsics together."""
    infos = [info for path, text in zip(files, texts, strict=True) for info in _infos(path, text)]
    if any(has_projection(info) for info in infos):
        return ros_cameras(files, infos)
    return matrices_cameras(files[-1], lower(" and ".join(map(str, files)), *infos))


def _infos(path: Path, text: str) -> list[dict[str, Any]]:
    return ini_values(text) if is_ini(text) else [markup_values(path, text)]


def _single(path: Path, text: str, folder: str | None) -> Cameras:
    if text.lstrip().startswith(("<", "{")) or re.search(r"^%YAML", text, re.MULTILINE):
        return matrices_cameras(path, markup_values(path, text))
    return _plain(path, text, folder)


def _plain(path: Path, text: str, folder: str | None) -> Cameras:
    if is_kitti(text):
        return kitti_cameras(path, text, folder)
    if re.search(r"^\s*camera\.A\s*=", text, re.MULTILINE):
        return key_value_cameras(named_lines(path, text))
    if re.search(r"^\s*(fx|K)\s*=", text, re.MULTILINE):
        return matrices_cameras(path, toml_values(path, text))
    if re.search(r"^\s*(cam[01]|doffs|ndisp)\s*=", text, re.MULTILINE):
        return middlebury_cameras(named_lines(path, text))
    if re.search(r"^(P1|Q|baseline)\s*:", text, re.MULTILINE | re.IGNORECASE):
        return matrices_cameras(path, yaml_values(path, text))
    if numbers := numbers_only(text):
        return intrinsics_cameras(path, numbers)
    raise unknown_format(path, _single_ros(text))


def _single_ros(text: str) -> str:
    alone = re.search(r"^\s*(projection_matrix|[Pp])\s*:", text, re.MULTILINE)
    return "; it looks like one of ROS's two files, give the other too" if alone else ""
