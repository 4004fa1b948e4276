"""MC-CNN fast and accurate as the ``mccnn`` package has them, with the weights that they learnt on Middlebury.

Source: Žbontar & LeCun, "Stereo matching by training a convolutional neural network to compare image patches",
JMLR 2016.
"""

from importlib import resources

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semidense.stages.baselines.declaration import MC_CNN_RADIUS, CheckedParams, Matched
from semidense.stages.baselines.window import match_windows
from semidense.stages.compute.threads import one_thread
from semidense.stages.stage import OfImages
from semidense.stages.transforms.gray import gray_views, to_gray

_FAST, _ACCURATE = "mc_cnn_fast_mb_weights.pt", "mc_cnn_accurate_mb_weights.pt"


def mc_cnn_costs(left: NDArray[np.uint8], right: NDArray[np.uint8], disparities: range) -> NDArray[np.float32]:
    """Return the cost volume of MC-CNN fast.

    Args:
        left: (y, x) uint8.
        right: (y, x) uint8.
        disparities: px, ``x_right = x_left - d``.

    Returns:
        (y, x, d) float32, lower is better. The views are continued by their edge, so that border pixels are answered.
    """
    from mc_cnn.run import run_mc_cnn_fast

    views = (np.pad(view.astype(np.float32), MC_CNN_RADIUS, mode="edge") for view in (left, right))
    weights = resources.files("mc_cnn") / "weights" / _FAST
    # The package answers where a patch lies within the view, here at every pixel of the view that was continued;
    # its disparity has the other sign, so its last slice is our first.
    costs = run_mc_cnn_fast(*views, -disparities[-1], -disparities[0], str(weights))
    return np.ascontiguousarray(costs[..., ::-1], np.float32)


def compute_mc_cnn(params: CheckedParams, inputs: OfImages) -> Matched:
    """Compute the product ``mc_cnn``: winner takes all over single costs, and its left-right check."""
    left, right = gray_views(inputs["images"])
    disparities = params.disparities
    volume = mc_cnn_costs(left, right, disparities)

    def costs(d: int, columns: slice, _: slice) -> NDArray[np.float32]:
        return volume[:, columns, d - disparities[0]]

    return match_windows(costs, left.shape, disparities, 1, params.tolerance)


@one_thread()
def compute_mc_cnn_accurate(params: CheckedParams, inputs: OfImages) -> Matched:
    """Compute a tile of the product ``mc_cnn_accurate``: as ``mc_cnn``, by the network that joins the two views."""
    from mc_cnn.model.mc_cnn_accurate import AccMcCnnInfer

    weights = str(resources.files("mc_cnn") / "weights" / _ACCURATE)
    net = AccMcCnnInfer()
    net.load_state_dict(torch.load(weights, map_location="cpu", weights_only=True)["model"])
    images = inputs["images"]
    with torch.inference_mode():
        left, right = (
            net.conv_blocks(_standardised(view, *moments))[0].permute(1, 2, 0)
            for view, moments in zip((images["left"], images["right"]), images["moments"], strict=True)
        )

        def costs(_: int, columns: slice, seen: slice) -> NDArray[np.float32]:
            # Without its sigmoid at the end, which makes ties of what is nearly certain.
            alike = net.fl_blocks[:-1](torch.cat([left[:, columns], right[:, seen]], 2))
            made: NDArray[np.float32] = -alike[..., 0].numpy()
            return made

        return match_windows(costs, images["left"].shape[:2], params.disparities, 1, params.tolerance)


def _standardised(view: NDArray[np.generic], mean: float, deviation: float) -> Tensor:
    """Return the gray of a view at mean 0 and deviation 1, continued by its edge: (1, 1, y + 10, x + 10)."""
    gray = (to_gray(view) - mean) / max(deviation, 1.0)
    return torch.from_numpy(np.pad(gray, MC_CNN_RADIUS, mode="edge").astype(np.float32))[None, None]
