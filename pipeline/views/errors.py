"""The colours of errors: five classes, from right to far off, that also the colour-blind can tell apart."""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stages.metrics import THRESHOLDS

ERROR_COLOURS = ("#FFF7BC", "#FEC44F", "#F2780C", "#C02A0A", "#6A0532")
"""Of errors up to each of ``THRESHOLDS``, and above the last: lighter is better. None is black, unknown truth gray."""
ERROR_LABELS = (
    f"at most {THRESHOLDS[0]:g} px",
    *(f"{low:g} to {high:g} px" for low, high in pairwise(THRESHOLDS)),
    f"above {THRESHOLDS[-1]:g} px",
)
UNKNOWN = "#8A8A8A"
"""A pixel whose truth is not known."""


def error_classes(error: NDArray[Any]) -> NDArray[np.float32]:
    """Return the class of each error, 0 to 4, as float32; NaN stays NaN.

    >>> error_classes(np.array([0.5, 0.6, 5.0, np.nan])).tolist()
    [0.0, 1.0, 4.0, nan]
    """
    return np.where(np.isnan(error), np.nan, np.searchsorted(THRESHOLDS, error, side="left")).astype(np.float32)
