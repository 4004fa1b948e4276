"""The two layers that the evaluation-Net looks at, as training and inference both make them."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.evaluation.net import DISPARITY_UNIT
from semidense.stages.stage import Array, StageError
from semidense.stages.transforms.gray import to_gray


def evaluation_layers(left: Array, moments: NDArray[np.float64], disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the input layers of the evaluation-Net.

    Args:
        left: (y, x), (y, x, 1) or (y, x, 3) uint8 or uint16, the left view.
        moments: mean and standard deviation of the whole view's 8-bit gray.
        disparity: float32 (y, x), raw disparity, px; NaN, where no cost was valid, counts as 0.

    Returns:
        float32 (layer, y, x): standardised gray, and disparity in units of ``DISPARITY_UNIT``.

    Raises:
        StageError: if the shapes differ.
    """
    gray = to_gray(left)
    if gray.shape != disparity.shape:
        raise StageError(f"the left view has {gray.shape} px, its disparity map {disparity.shape}: they must be equal")
    mean, std = moments
    standardised = (gray - np.float64(mean)) / max(float(std), 1.0)
    return np.stack([standardised, np.nan_to_num(disparity) / DISPARITY_UNIT]).astype(np.float32)
