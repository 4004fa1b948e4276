"""Read the ``camera_parameters.txt`` of industrial stereo sensors, such as the rc_visard: lines ``name=value``.

::

    camera.A=[1104.37 0 640; 0 1104.37 480; 0 0 1]     camera matrix of both rectified views
    camera.height=960
    camera.width=1280
    t=0.16005                                          baseline, metres
    rho=176.75491                                      focal length times baseline, pixels times metres

Comments follow a ``#``; other names (``disp.scale``, ...) are passed over. Both views share the principal point.
"""

import numpy as np

from semidense.datasets.formats.calibration.cameras import Cameras
from semidense.datasets.formats.calibration.text import CAMERA, NamedLines, camera, count, positive

_COUNT = "a whole number above 0"
_SAME = 1e-3


def key_value_cameras(entries: NamedLines) -> Cameras:
    """Return what the lines say.

    Raises:
        CalibrationError: If an entry is missing or not valid; the line is named.
    """
    shared = entries.get("camera.A", camera, CAMERA)
    baseline = entries.get("t", positive, "the baseline in metres, above 0")
    size = (entries.get("camera.height", count, _COUNT), entries.get("camera.width", count, _COUNT))
    left, right = (np.column_stack([shared, [shift, 0, 0]]) for shift in (0, -shared[0, 0] * baseline))
    warnings = _contradiction(entries, float(shared[0, 0]) * baseline)
    return Cameras(entries.path, left, right, "m", size, warnings=warnings)


def _contradiction(entries: NamedLines, product: float) -> tuple[str, ...]:
    if "rho" not in entries.lines:
        return ()
    rho = entries.get("rho", positive, "a number above 0")
    if abs(rho - product) <= _SAME * rho:
        return ()
    return (f"{entries.path}: rho is {rho:g}, but fx times t is {product:g}; fx and t count",)
