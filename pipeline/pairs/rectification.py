"""Rectify a pair with OpenCV and a stereo calibration that was made with OpenCV.

The calibration is what ``cv2.stereoCalibrate`` gives: ``M1 D1 M2 D2`` (camera matrices and distortions) and ``R T``
(pose of the right camera); or, after ``cv2.stereoRectify``, ``R1 R2 P1 P2`` instead of the latter.
Source: OpenCV's ``stereoRectify``, ``initUndistortRectifyMap`` and ``remap``.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.datasets.errors import CalibrationError
from semidense.datasets.formats.calibration.cameras import MILLIMETRES, Cameras, calibrated
from semidense.datasets.formats.calibration.markup import lower, markup_values
from semidense.datasets.formats.calibration.matrices import stored_size
from semidense.datasets.formats.calibration.text import Matrix, floats, matrix, read_text
from semidense.datasets.formats.images import read_image
from semidense.pipeline.execution.tasks import provenance
from semidense.pipeline.files.publishing import publishing
from semidense.pipeline.files.writing import write_rgb
from semidense.pipeline.plan.errors import UsageError

Image = NDArray[Any]
RECORD = "rectified.json"
_NAMES: Mapping[str, tuple[str, ...]] = {
    "m1": ("m1", "k1", "cameramatrix1", "camera_matrix_1", "camera_matrix_left", "left_camera_matrix"),
    "m2": ("m2", "k2", "cameramatrix2", "camera_matrix_2", "camera_matrix_right", "right_camera_matrix"),
    "d1": ("d1", "distcoeffs1", "dist_coeffs_1", "distortion_left", "dist_1", "left_distortion"),
    "d2": ("d2", "distcoeffs2", "dist_coeffs_2", "distortion_right", "dist_2", "right_distortion"),
}
"""Names in lower case under which people store camera matrices and distortions."""
_DISTORTIONS = (4, 5, 8, 12, 14)
"""Numbers of coefficients that OpenCV's models have."""
_TURNED = 0.01
"""Largest entry by which a rotation times its transpose may differ from the identity: files round."""


@dataclass(frozen=True, eq=False)
class StereoRig:
    """Two cameras, and how their images are to be rectified; matrices as OpenCV has them.

    Attributes:
        cameras: the two camera matrices (3, 3), px.
        distortions: the coefficients of each lens.
        rotations: (3, 3), of each camera, into the shared orientation.
        projections: (3, 4), of the rectified cameras.
    """

    cameras: tuple[Matrix, Matrix]
    distortions: tuple[Matrix, Matrix]
    rotations: tuple[Matrix, Matrix]
    projections: tuple[Matrix, Matrix]


def read_rig(files: Sequence[Path], size: tuple[int, int], alpha: float = 0.0) -> StereoRig:
    """Read an OpenCV stereo calibration.

    Args:
        files: YAML, XML or JSON with ``M1 D1 M2 D2`` and ``R T``, or ``R1 R2 P1 P2``, in one file or in several, as
            OpenCV's sample writes ``intrinsics.yml`` and ``extrinsics.yml``.
        size: rows and columns of the images.
        alpha: with ``R T``: 0 shows only pixels that both lenses saw, 1 keeps every pixel.

    Raises:
        CalibrationError: if a matrix is missing or not valid, the cameras do not stand side by side, two files
            contradict each other, or one is of images of another size.
    """
    path, values = files[0], _values(files, size)
    cameras = _camera(path, values, "m1"), _camera(path, values, "m2")
    distortions = _distortion(path, values, "d1"), _distortion(path, values, "d2")
    if {"r1", "r2", "p1", "p2"} <= values.keys():
        rotations = _rotation(path, values, "r1"), _rotation(path, values, "r2")
        projections = _matrix(path, values, "p1", (3, 4)), _matrix(path, values, "p2", (3, 4))
        rig = StereoRig(cameras, distortions, rotations, projections)
    elif {"r", "t"} <= values.keys():
        pose = _rotation(path, values, "r"), _matrix(path, values, "t", (3, 1))
        if not pose[1].any():
            raise CalibrationError(f"{path}: T is 0: both cameras would stand in one place")
        rig = _rectified(cameras, distortions, pose, size, alpha)
    else:
        raise CalibrationError(f"{path}: neither R and T nor R1, R2, P1 and P2; save what cv2.stereoCalibrate gives")
    calibrated(Cameras(path, *rig.projections, unit="m"))  # what match would refuse later is refused here
    return rig


def _values(files: Sequence[Path], size: tuple[int, int]) -> dict[str, Any]:
    """Return the values of all files, names in lower case."""
    found = [markup_values(path, read_text(path)) for path in files]
    for path, each in zip(files, found, strict=True):
        _require_size(path, lower(str(path), each), size)
    return lower(" and ".join(map(str, files)), *found)


def _rectified(
    cameras: tuple[Matrix, Matrix],
    distortions: tuple[Matrix, Matrix],
    pose: tuple[Matrix, Matrix],
    size: tuple[int, int],
    alpha: float,
) -> StereoRig:
    first, second, left, right, *_ = _opencv().stereoRectify(
        cameras[0], distortions[0], cameras[1], distortions[1], size[::-1], *pose, alpha=alpha
    )
    return StereoRig(cameras, distortions, (first, second), (left, right))


def rectify(left: Image, right: Image, rig: StereoRig) -> tuple[Image, Image]:
    """Return both views as rectified cameras would see them: the same sizes and types, black where nothing is known."""
    views = zip((left, right), rig.cameras, rig.distortions, rig.rotations, rig.projections, strict=True)
    first, second = (_remapped(*each) for each in views)
    return first, second


def _remapped(view: Image, camera: Matrix, distortion: Matrix, rotation: Matrix, projection: Matrix) -> Image:
    cv2 = _opencv()
    columns_rows = view.shape[1], view.shape[0]
    maps = cv2.initUndistortRectifyMap(camera, distortion, rotation, projection, columns_rows, cv2.CV_32FC1)
    found: Image = cv2.remap(view, *maps, cv2.INTER_CUBIC)
    return found.reshape(view.shape)


def rectify_files(
    left: Path, right: Path, calibration: Sequence[Path], folder: Path, unit: str | None = None, alpha: float = 0.0
) -> list[Path]:
    """Rectify two files; write ``left.png``, ``right.png``, ``calibration.json`` and a record, and return their paths.

    ``pipeline match left.png right.png --calib calibration.json`` takes what is written, with ``--unit`` if
    none was given here.

    Raises:
        DatasetError, CalibrationError: if a view or the calibration cannot be read.
        UsageError: if the views differ in size, the unit is not known, OpenCV is missing, or a file of somebody else
            would be replaced.
    """
    if unit not in (None, *MILLIMETRES):
        raise UsageError(f"unit {unit!r} of length is not known; give mm, cm or m")
    views = read_image(left), read_image(right)
    size = (views[0].shape[0], views[0].shape[1])
    if views[1].shape[:2] != size:
        rows, columns = views[1].shape[:2]
        raise UsageError(f"{left} has {size[0]} x {size[1]} pixels and {right} has {rows} x {columns}; they must agree")
    rig = read_rig(calibration, size, alpha)
    with publishing(folder, RECORD, (left, right, *calibration)) as draft:
        for name, view in zip(("left.png", "right.png"), rectify(*views, rig), strict=True):
            write_rgb(view, draft / name)
        (draft / "calibration.json").write_text(json.dumps(_described(rig, size, unit), indent=1) + "\n")
        names = ["left.png", "right.png", "calibration.json", RECORD]
        (draft / RECORD).write_text(json.dumps(provenance(sys.argv) | {"files": names}, indent=2) + "\n")
    return [folder / name for name in names]


def _described(rig: StereoRig, size: tuple[int, int], unit: str | None) -> dict[str, Any]:
    """Return the rectified cameras as ``match --calib`` reads them."""
    told = {"unit": unit} if unit else {}
    matrices = {name: values.tolist() for name, values in zip(("P1", "P2"), rig.projections, strict=True)}
    return matrices | {"image_width": size[1], "image_height": size[0]} | told


def _matrix(path: Path, values: Mapping[str, Any], name: str, shape: tuple[int, int]) -> Matrix:
    found = _value(values, name)
    if found is None:
        raise CalibrationError(f"{path}: no {name.upper()}; save M1 D1 M2 D2 R T of cv2.stereoCalibrate")
    return matrix(path, name.upper(), found, shape)


def _camera(path: Path, values: Mapping[str, Any], name: str) -> Matrix:
    found = _matrix(path, values, name, (3, 3))
    if not (found[0, 0] > 0 and found[1, 1] > 0 and (found[2] == (0, 0, 1)).all()):
        raise CalibrationError(f"{path}: {name.upper()} is no camera matrix: fx 0 cx, 0 fy cy, 0 0 1, in pixels")
    return found


def _rotation(path: Path, values: Mapping[str, Any], name: str) -> Matrix:
    found = _matrix(path, values, name, (3, 3))
    if np.abs(found @ found.T - np.eye(3)).max() > _TURNED or np.linalg.det(found) < 0:
        raise CalibrationError(f"{path}: {name.upper()} is no rotation: its rows are not at right angles, of length 1")
    return found


def _distortion(path: Path, values: Mapping[str, Any], name: str) -> Matrix:
    """Return the coefficients of a lens; without any, it does not distort."""
    found = _value(values, name)
    if found is None:
        return np.zeros((1, 5))
    count = floats(found).size if isinstance(found, list) else 0
    if count not in _DISTORTIONS:
        raise CalibrationError(
            f"{path}: {name.upper()} is no list of 4, 5, 8, 12 or 14 numbers, which OpenCV's models have "
            "(a fisheye calibration has another model, and is not read)"
        )
    return matrix(path, name.upper(), found, (1, count))


def _value(values: Mapping[str, Any], name: str) -> object:
    """Return the numbers stored under one of a value's names; OpenCV stores a matrix as an object with ``data``."""
    found = next((values[each] for each in _NAMES.get(name, (name,)) if each in values), None)
    return found.get("data") if isinstance(found, dict) else found


def _require_size(path: Path, values: Mapping[str, Any], size: tuple[int, int]) -> None:
    told = stored_size(path, values)
    if any(side not in (None, own) for side, own in zip(told, size, strict=True)):
        raise CalibrationError(
            f"{path}: it is of images of {told[0] or '?'} x {told[1] or '?'} pixels, these have {size[0]} x {size[1]}; "
            "calibrate with images of this size"
        )


def _opencv() -> Any:  # noqa: ANN401
    """Return OpenCV.

    Raises:
        UsageError: if it is not installed.
    """
    try:
        import cv2
    except ImportError:
        raise UsageError("rectifying needs OpenCV: pip install 'semidense-stereo[baselines]'") from None
    return cv2
