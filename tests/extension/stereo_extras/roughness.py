"""The roughness of a filtered map."""

import numpy as np

from semidense.stages.stage import Arrays, Inputs
from stereo_extras.declaration import RoughnessParams


def compute_roughness(params: RoughnessParams, inputs: Inputs) -> Arrays:
    """Return the largest step from each pixel to its neighbours, px; NaN where neither they nor it have one."""
    disparity = inputs["semidense"]["disparity"]
    beside = np.pad(disparity, ((0, 0), (params.reach, params.reach)), constant_values=np.nan)
    steps = [np.abs(disparity - other) for other in (beside[:, : -2 * params.reach], beside[:, 2 * params.reach :])]
    return {"roughness": np.fmax(*steps)}
