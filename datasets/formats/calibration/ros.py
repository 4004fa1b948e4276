"""Turn the two ``CameraInfo`` of a ROS pair, left and right, into cameras; in metres.

Their values come from files that ``camera_calibration`` writes, or from messages as ``rostopic echo`` or ``ros2 topic
echo`` prints them. A message's ``roi`` and ``binning`` say which part of the full image was sent, and how coarsely. The
projection matrix is that of the full image: the offset is taken off ``cx`` and ``cy``, then the first two rows are
divided by the binning.
Sources: ROS message ``sensor_msgs/CameraInfo``; ``image_geometry``'s ``PinholeCameraModel``.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from semidense.datasets.errors import CalibrationError
from semidense.datasets.formats.calibration.cameras import Cameras, unknown_format
from semidense.datasets.formats.calibration.text import Matrix, matrix

_PROJECTION = ("projection_matrix", "P", "p")


def has_projection(info: Mapping[str, Any]) -> bool:
    """Tell whether values are those of a ``CameraInfo``."""
    return any(name in info for name in _PROJECTION)


def ros_cameras(files: Sequence[Path], infos: Sequence[Mapping[str, Any]]) -> Cameras:
    """Return what two ``CameraInfo`` say.

    Args:
        files: One file of both, or a left and a right one.
        infos: Their values, left and right.

    Raises:
        CalibrationError: If they are not two, one is no ``CameraInfo``, or they are of images of different size.
    """
    left, right = files[0], files[-1]
    if len(infos) != 2:
        raise unknown_format(
            right, f"; {len(infos)} camera{'s' * (len(infos) > 1)} of ROS: give the left and the right one"
        )
    size, other = _size(left, infos[0]), _size(right, infos[1])
    if other != size:
        raise CalibrationError(f"{right}: image of {other}, but {left} is of {size} (rows, columns)")
    return Cameras(right, _projection(left, infos[0]), _projection(right, infos[1]), "m", size)


def _projection(path: Path, info: Mapping[str, Any]) -> Matrix:
    found = next((info[name] for name in _PROJECTION if name in info), None)
    full = matrix(path, "projection_matrix (or P)", found.get("data") if isinstance(found, dict) else found, (3, 4))
    for row, axis in enumerate("xy"):
        full[row, 2] -= _roi(path, info, f"{axis}_offset")
        full[row] /= _binning(path, info, axis)
    return full


def _size(path: Path, info: Mapping[str, Any]) -> tuple[int, int] | None:
    """Return rows and columns of the image that was sent."""
    rows, columns = (
        (_roi(path, info, side) or _whole(path, info, f"image_{side}") or _whole(path, info, side))
        // _binning(path, info, axis)
        for side, axis in (("height", "y"), ("width", "x"))
    )
    return (rows, columns) if rows and columns else None


def _roi(path: Path, info: Mapping[str, Any], name: str) -> int:
    found = info.get("roi")
    return _whole(path, found, name) if isinstance(found, dict) else 0


def _binning(path: Path, info: Mapping[str, Any], axis: str) -> int:
    return _whole(path, info, f"binning_{axis}") or 1


def _whole(path: Path, values: Mapping[str, Any], name: str) -> int:
    value = values.get(name, 0)
    if not isinstance(value, int) or value < 0:
        raise CalibrationError(f"{path}: {name} is {value!r}; expected a whole number of pixels")
    return value
