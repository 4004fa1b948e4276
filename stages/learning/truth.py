"""Which kind of truth a training scene has: a dense one, or a sparse one by a laser scanner."""

import numpy as np
from numpy.typing import NDArray

DENSE = 0.5
"""Share of known pixels above which a truth is dense; the laser scanner of KITTI gives 13 to 35 %."""


def is_dense(truth: NDArray[np.float32]) -> bool:
    """Say whether the disparities of most pixels (y, x) are known; NaN where one is not."""
    return bool(np.isfinite(truth).mean() > DENSE)
