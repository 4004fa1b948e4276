"""The filtered map after a left-right check and a sub-pixel step, each if asked for."""

import numpy as np

from semidense.stages.disparity.declaration import OfFiltered, RefinedParams
from semidense.stages.disparity.right_view import agreeing
from semidense.stages.disparity.winner_takes_all import refine_subpixel
from semidense.stages.stage import DisparityMap


def compute_refined(params: RefinedParams, inputs: OfFiltered) -> DisparityMap:
    """Compute the product ``refined``; see ``agreeing`` and ``refine_subpixel``.

    Disparities that are no whole numbers were refined before the filter (``disparity.subpixel``) and stay.
    """
    disparity = inputs["semidense"]["disparity"]
    if params.left_right:
        disparity = agreeing(disparity, inputs["right_disparity"]["disparity"], params.tolerance)
    if params.subpixel:
        volume = inputs["costvolume"]
        whole = disparity == np.rint(disparity)
        refined = refine_subpixel(volume["cost"], np.where(whole, disparity, np.float32(np.nan)), int(volume["d"][0]))
        disparity = np.where(whole, refined, disparity)
    return {"disparity": disparity.astype(np.float32, copy=False)}
