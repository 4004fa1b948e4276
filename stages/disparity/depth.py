"""From disparities to metres: depth, and the points in space."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.stage import StageError, require_shape


def depth(disparity: NDArray[Any], focal: float, baseline: float, doffs: float = 0.0) -> NDArray[np.float32]:
    """Return the depth of each pixel.

    ``Z = baseline * focal / (d + doffs)``

    Args:
        disparity: (y, x) float, px; NaN unknown.
        focal: focal length, px.
        baseline: distance of the cameras, in the unit that the depth is to have.
        doffs: column of the right principal point minus that of the left, px.

    Returns:
        (y, x) float32, in the unit of ``baseline``, along the optical axis from the left camera; NaN where the
        disparity is, and where ``d + doffs`` is not above 0: such a point lies at infinity or beyond.

    Raises:
        StageError: if focal length or baseline are not above 0.

    Source: Middlebury stereo, "Calibration file format", https://vision.middlebury.edu/stereo/data/scenes2014/

    >>> depth(np.array([[10.0, 30.0, -10.0, np.nan]]), focal=1000, baseline=0.2, doffs=10).tolist()
    [[10.0, 5.0, nan, nan]]
    """
    if not (focal > 0 and baseline > 0):
        raise StageError(f"focal length {focal:g} px and baseline {baseline:g}: both must be above 0")
    shifted = disparity.astype(np.float64) + doffs
    result = np.full(disparity.shape, np.nan)
    np.divide(baseline * focal, shifted, out=result, where=shifted > 0)
    return result.astype(np.float32)


def points(
    distance: NDArray[np.float32],
    focal: float,
    centre: tuple[float, float],
    focal_y: float | None = None,
    skew: float = 0.0,
) -> NDArray[np.float32]:
    """Return the points in space of the pixels that have a depth, row by row.

    ``Y = (y - cy) Z / fy`` and ``X = ((x - cx) Z - skew Y) / fx``, given as ``X``, ``-Y`` and ``-Z``: x to the right,
    y up, z towards the viewer, as the common viewers of point clouds have it, so that a cloud opens right side up and
    seen from the camera.

    Args:
        distance: (y, x) float32 depth, NaN unknown.
        focal: along x, px.
        centre: column and row of the principal point, px.
        focal_y: along y, px; None for that along x.
        skew: of the camera matrix, px.

    Returns:
        (point, 3) float32 in the unit of the depth.

    >>> points(np.float32([[2, np.nan, 2]]), focal=2, centre=(1, 0)).tolist()
    [[-1.0, 0.0, -2.0], [1.0, 0.0, -2.0]]
    """
    require_shape("depth", distance, 2)
    rows, columns = np.nonzero(np.isfinite(distance))
    z = distance[rows, columns].astype(np.float64)
    up = (centre[1] - rows) * z / (focal_y or focal)
    placed = np.stack([((columns - centre[0]) * z + skew * up) / focal, up, -z], axis=1)
    return (placed + 0.0).astype(np.float32)
