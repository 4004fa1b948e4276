"""Turn the two projection matrices of a rectified pair into what depth needs, and say what looks wrong with them.

A camera projects ``[x y 1] ~ P [X Y Z 1]`` with ``P = [fx s cx Tx; 0 fy cy Ty; 0 0 1 0]`` and ``Tx = -fx * position``.
Both cameras of a rectified pair are moved along x only, so

- ``baseline = (P_left[0, 3] - P_right[0, 3]) / fx``: the left camera need not be the origin (KITTI's colour cameras);
- ``doffs = cx_right - cx_left``, and ``Z = baseline * fx / (d + doffs)``.

Sources: OpenCV's ``stereoRectify``; ROS message ``sensor_msgs/CameraInfo``; KITTI's development kit.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from semidense.datasets.errors import CalibrationError
from semidense.datasets.formats.calibration.text import Matrix
from semidense.datasets.scene import Calibration

MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0}
"""Millimetres of each unit that a calibration may be in."""
_SHORT = {"millimeter": "mm", "centimeter": "cm", "meter": "m"}
UNDERSTOOD = (
    "Middlebury's calib.txt (cam0=[...]); OpenCV's YAML, XML or JSON (P1 and P2, or Q); ROS's CameraInfo or .ini, a "
    "left and a right file; KITTI's (P2: ..., P_rect_02: ..., P1_roi: ...); a K.txt of nine numbers and the baseline "
    "in metres; JSON, YAML or TOML with fx, fy, cx, cy or K, and baseline; a stereo sensor's camera.A=[...] and t=..."
)
"""The formats of calibrations that are read, for messages."""
VERTICAL = "the cameras stand one above the other; only a pair side by side can be matched"
_USUAL = (1.0, 10_000.0)
"""Baselines outside of this are rare, and more often a wrong unit; millimetres."""
_FIXED = ((1, 0), (2, 0), (2, 1), (2, 2))
"""Entries of a projection matrix that every camera has alike: 0, 0, 0 and 1."""
_SAME = 1e-6
_SAME_ROWS = 1e-3
"""Relative difference of two focal lengths along y that shifts no row by more than a pixel."""
_SAME_PIXEL = 0.05
"""Difference of two principal points that rounding in a file may cause, pixels."""
_SAME_SHAPE = 0.01
"""Relative difference of the two sides' scales that rounding a size to whole pixels may cause."""


def unknown_format(path: Path, hint: str = "") -> CalibrationError:
    """Return the error for a file that is no known calibration; it lists what is understood."""
    return CalibrationError(f"{path}: no known calibration format{hint}. Known are: {UNDERSTOOD}")


@dataclass(frozen=True, eq=False)
class Cameras:
    """Hold what a file says of a rectified pair.

    Attributes:
        path: The file, for messages.
        left: (3, 4) projection matrix of the left camera, pixels; its last column pixels times the unit of length.
        right: The right camera's.
        unit: Unit of length as the file names it, such as ``mm`` or ``meters``; None if it does not tell.
        size: Rows and columns of the images; None if the file does not tell.
        ndisp: Number of disparities to search, from 0 on; None if the file does not tell.
        doffs: ``doffs`` as the file states it; None where only the matrices tell.
        warnings: What looks wrong, a line each.
    """

    path: Path
    left: Matrix
    right: Matrix
    unit: str | None
    size: tuple[int, int] | None = None
    ndisp: int | None = None
    doffs: float | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class PairCalibration:
    """Hold what is known of a rectified pair.

    Attributes:
        calibration: Focal lengths and principal point of the left camera, baseline in millimetres, ``doffs``.
        size: Rows and columns of the images, None if the file does not tell.
        ndisp: Number of disparities to search, None if the file does not tell.
        warnings: What looks wrong, a line each.
    """

    calibration: Calibration
    size: tuple[int, int] | None = None
    ndisp: int | None = None
    warnings: tuple[str, ...] = ()

    def fitted(self, what: str, size: tuple[int, int]) -> "PairCalibration":
        """Return the calibration of images of a size, scaled if it was made at another resolution of the same shape.

        Pixel centres lie on whole numbers: by a scale ``s``, ``cx`` becomes ``s (cx + 0.5) - 0.5``.

        Args:
            what: The pair, for messages.
            size: Rows and columns of the images.

        Raises:
            CalibrationError: If the calibration's images have another shape: they were cropped, which no size tells.
        """
        known = self if self.size in (None, size) else self._scaled(what, size)
        warnings = (*known.warnings, *_outside(known.calibration, size))
        return replace(known, size=size, warnings=warnings)

    def _scaled(self, what: str, size: tuple[int, int]) -> "PairCalibration":
        rows, columns = self.size or size
        down, across = size[0] / rows, size[1] / columns
        sizes = f"the calibration is of {rows} x {columns} pixels, the images have {size[0]} x {size[1]}"
        if abs(down - across) > _SAME_SHAPE * max(down, across):
            raise CalibrationError(f"{what}: {sizes}: another shape; take the calibration of these images")
        ndisp = None if self.ndisp is None else int(np.ceil(self.ndisp * across))
        warning = f"{sizes}: it was scaled by {across:.6g}; if the images were cropped instead, depth is wrong"
        return replace(
            self, calibration=_resized(self.calibration, across, down), ndisp=ndisp, warnings=(*self.warnings, warning)
        )


def require_unit(unit: object) -> None:
    """Refuse a unit of length that a user gave and that is not known: CalibrationError."""
    if unit not in (None, *MILLIMETRES):
        raise CalibrationError(f"unit {unit!r} of a calibration; give {', '.join(MILLIMETRES)}")


def calibrated(cameras: Cameras, unit: str | None = None) -> PairCalibration:
    """Return what depth needs.

    Args:
        cameras: What a file says.
        unit: Unit of length that replaces the file's own.

    Raises:
        CalibrationError: If no unit is known, or the cameras are no rectified pair side by side.
    """
    scale = _millimetres(cameras.path, unit or cameras.unit)
    left, right = cameras.left, cameras.right
    focal = _shared_focal(cameras)
    _require_pinholes(cameras)
    baseline = _shift(cameras) / focal * scale
    doffs = float(right[0, 2] - left[0, 2]) if cameras.doffs is None else cameras.doffs
    focal_y = None if abs(left[1, 1] - focal) <= _SAME * focal else float(left[1, 1])
    centre = (float(left[0, 2]), float(left[1, 2]))
    known = Calibration(focal, baseline, doffs, centre, focal_y, float(left[0, 1]))
    warnings = (*cameras.warnings, *_contradictions(cameras), *_unusual(cameras.path, baseline))
    return PairCalibration(known, cameras.size, cameras.ndisp, warnings)


def _millimetres(path: Path, unit: str | None) -> float:
    """Return the millimetres of a unit, whose name may be written out."""
    if unit is None:
        raise CalibrationError(f"{path}: the file does not tell its unit of length; give unit mm, cm or m")
    name = unit.strip().lower().rstrip("s").replace("metre", "meter")
    short = _SHORT.get(name, name)
    if short not in MILLIMETRES:
        raise CalibrationError(f"{path}: unit {unit!r} of length is not known; give unit mm, cm or m")
    return MILLIMETRES[short]


def _require_pinholes(cameras: Cameras) -> None:
    for side, projection in (("left", cameras.left), ("right", cameras.right)):
        if not np.allclose([projection[place] for place in _FIXED], [0, 0, 0, 1]):
            raise CalibrationError(
                f"{cameras.path}: the {side} camera matrix is not [fx s cx; 0 fy cy; 0 0 1]; is it transposed?"
            )


def _unusual(path: Path, baseline: float) -> Iterator[str]:
    if not _USUAL[0] <= baseline <= _USUAL[1]:
        yield f"{path}: the cameras stand {baseline:g} mm apart; if that is wrong, give the file's unit: mm, cm or m"


def _shared_focal(cameras: Cameras) -> float:
    left, right = float(cameras.left[0, 0]), float(cameras.right[0, 0])
    if left <= 0 or cameras.left[1, 1] <= 0 or abs(left - right) > _SAME * abs(left):
        raise CalibrationError(
            f"{cameras.path}: focal lengths {left:g} and {right:g}; a rectified pair shares one above 0"
        )
    return left


def _shift(cameras: Cameras) -> float:
    """Return the baseline times the focal length, above 0."""
    shift, vertical = (float(cameras.left[row, 3] - cameras.right[row, 3]) for row in (0, 1))
    if abs(vertical) > abs(shift):
        raise CalibrationError(f"{cameras.path}: {VERTICAL}")
    if shift == 0:
        raise CalibrationError(f"{cameras.path}: both cameras stand in one place (the same Tx); take the file of each")
    if shift < 0:
        distance = -shift / float(cameras.left[0, 0])
        raise CalibrationError(
            f"{cameras.path}: the right camera stands {distance:g} to the left; exchange the two views"
        )
    return shift


def _contradictions(cameras: Cameras) -> Iterator[str]:
    """Yield what the matrices say that no rectified pair can have, with both numbers."""
    left, right, path = cameras.left, cameras.right, cameras.path
    if abs(left[1, 2] - right[1, 2]) > _SAME_PIXEL:
        yield (
            f"{path}: cy is {left[1, 2]:g} in the left view and {right[1, 2]:g} in the right one; "
            "a rectified pair shares it, so points do not lie on the same row"
        )
    if abs(left[1, 1] - right[1, 1]) > _SAME_ROWS * left[1, 1]:
        yield f"{path}: fy is {left[1, 1]:g} in the left view and {right[1, 1]:g} in the right one; rectify them anew"
    if abs(left[0, 1] - right[0, 1]) > _SAME * left[0, 0]:
        yield f"{path}: skew is {left[0, 1]:g} in the left view and {right[0, 1]:g} in the right one; rectify them anew"
    told, measured = cameras.doffs, float(right[0, 2] - left[0, 2])
    if told is not None and abs(told - measured) > _SAME_PIXEL:
        yield f"{path}: doffs is {told:g}, but the right cx minus the left one is {measured:g}; doffs counts"


def _outside(known: Calibration, size: tuple[int, int]) -> Iterator[str]:
    if known.centre and not (0 <= known.centre[0] < size[1] and 0 <= known.centre[1] < size[0]):
        column, row = known.centre
        yield (
            f"the principal point (column {column:g}, row {row:g}) lies outside the image of {size[0]} x {size[1]} "
            "pixels; is the calibration of these images, at this resolution?"
        )


def _resized(known: Calibration, across: float, down: float) -> Calibration:
    centre = known.centre and ((known.centre[0] + 0.5) * across - 0.5, (known.centre[1] + 0.5) * down - 0.5)
    focal_y = known.focal_y and known.focal_y * down
    return Calibration(known.focal * across, known.baseline, known.doffs * across, centre, focal_y, known.skew * across)
