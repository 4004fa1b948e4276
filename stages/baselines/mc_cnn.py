"""MC-CNN fast as the ``mccnn`` package has it, with the weights that it learnt on Middlebury."""

from importlib import resources

import numpy as np
from numpy.typing import NDArray

from stages.baselines.declaration import CheckedParams
from stages.baselines.window import match_windows
from stages.stage import Arrays, Inputs
from stages.transforms.gray import to_gray

_WEIGHTS = "mc_cnn_fast_mb_weights.pt"
_RADIUS = 5
"""Half of the network's patch of 11 x 11 px."""


def mc_cnn_costs(left: NDArray[np.uint8], right: NDArray[np.uint8], disparities: range) -> NDArray[np.float32]:
    """Return the cost volume of MC-CNN fast.

    Args:
        left: (y, x) uint8.
        right: (y, x) uint8.
        disparities: px, ``x_right = x_left - d``.

    Returns:
        (y, x, d) float32, lower is better. The views are continued by their edge, so that border pixels are answered.

    Source: Žbontar & LeCun, "Stereo matching by training a convolutional neural network to compare image patches",
    JMLR 2016.
    """
    from mc_cnn.run import run_mc_cnn_fast

    views = (np.pad(view.astype(np.float32), _RADIUS, mode="edge") for view in (left, right))
    weights = resources.files("mc_cnn") / "weights" / _WEIGHTS
    # The package answers where a patch lies within the view, here at every pixel of the view that was continued;
    # its disparity has the other sign, so its last slice is our first.
    costs = run_mc_cnn_fast(*views, -disparities[-1], -disparities[0], str(weights))
    return np.ascontiguousarray(costs[..., ::-1], np.float32)


def compute_mc_cnn(params: CheckedParams, inputs: Inputs) -> Arrays:
    """Compute the product ``mc_cnn``: winner takes all over single costs, and its left-right check."""
    left, right = (to_gray(inputs["images"][view]) for view in ("left", "right"))
    disparities = params.disparities
    volume = mc_cnn_costs(left, right, disparities)

    def costs(d: int, columns: slice, _: slice) -> NDArray[np.float32]:
        return volume[:, columns, d - disparities[0]]

    return match_windows(costs, left.shape, disparities, 1, params.tolerance)
