"""Name the kinds of array that scenes are made of."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

ImageArray: TypeAlias = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]
"""An image: (y, x) gray or (y, x, 3) RGB, 8 or 16 bits a channel."""

DisparityMap: TypeAlias = npt.NDArray[np.float32]
"""Disparities in pixels, (y, x), NaN where unknown."""

Mask: TypeAlias = npt.NDArray[np.bool_]
"""Pixels that belong, (y, x)."""
