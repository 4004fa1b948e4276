"""The roughness of a filtered map."""

import numpy as np

from semidense.stages.stage import Arrays, Inputs
from stereo_extras.declaration import RoughnessParams


def compute_roughness(params: RoughnessParams, inputs: Inputs) -> Arrays:
    """Return the largest step from each pixel to its neighbours, px; NaN where one has no disparity."""
    disparity = inputs["semidense"]["disparity"]
    steps = [np.abs(disparity - np.roll(disparity, shift, axis=1)) for shift in (-params.reach, params.reach)]
    return {"roughness": np.maximum(*steps)}
