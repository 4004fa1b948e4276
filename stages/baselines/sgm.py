"""Semi-global matching as OpenCV has it (SGBM), along eight paths."""

import numpy as np
from numpy.typing import NDArray

from semidense.stages.baselines.declaration import Matched, SgmParams
from semidense.stages.stage import OfImages
from semidense.stages.transforms.gray import gray_views

_UNITS = 16
"""OpenCV's disparities are whole multiples of 1/16 px, and their number must be a multiple of 16 too."""
_UNCHECKED = 1_000_000
"""A left-right difference that no pixel reaches, px: OpenCV takes 0 and less for 1, and drops what differs by more."""
_SPECKLE_RANGE = 2
"""Largest step within a patch, px."""


def match_semi_global(
    left: NDArray[np.uint8], right: NDArray[np.uint8], params: SgmParams, *, checked: bool
) -> NDArray[np.float32]:
    """Return the disparity that OpenCV's SGBM finds in mode ``HH`` (eight paths).

    Args:
        left: (y, x) uint8.
        right: (y, x) uint8.
        params: range, block and penalties.
        checked: drop what fails the left-right check, is not unique or is a speckle, as OpenCV does it: nothing is
            said in a band at the border whose search would leave the right image. Without, the views are continued
            by their edge, and every pixel is answered.

    Returns:
        (y, x) float32, px, in steps of 1/16; NaN where nothing is reported: with ``checked`` everywhere if the range,
        rounded up to whole sixteens, is too wide for the image.
    """
    import cv2

    disparities = params.disparities
    searched = -(-len(disparities) // _UNITS) * _UNITS
    if checked and left.shape[1] - (disparities[0] + searched) <= params.window // 2:  # OpenCV raises here
        return np.full(left.shape, np.nan, np.float32)
    margin = 0 if checked else max(abs(disparities[0]), abs(disparities[-1])) + _UNITS
    left, right = (np.pad(view, ((0, 0), (margin, margin)), mode="edge") for view in (left, right))
    matcher = cv2.StereoSGBM.create(
        minDisparity=disparities[0],
        numDisparities=searched,
        blockSize=params.window,
        P1=params.p1,
        P2=params.p2,
        disp12MaxDiff=params.tolerance if checked else _UNCHECKED,
        uniquenessRatio=params.uniqueness if checked else 0,
        speckleWindowSize=params.speckle if checked else 0,
        speckleRange=_SPECKLE_RANGE,
        mode=cv2.STEREO_SGBM_MODE_HH,
    )
    found = matcher.compute(left, right)[:, margin : left.shape[1] - margin].astype(np.float32) / _UNITS
    found = np.where(found < disparities[0], np.float32(np.nan), found)
    if checked:
        return np.where(found > disparities[-1], np.float32(np.nan), found)
    return np.minimum(found, np.float32(disparities[-1]))  # OpenCV searches whole sixteens, beyond our range


def compute_sgm(params: SgmParams, inputs: OfImages) -> Matched:
    """Compute the product ``sgm``; see ``match_semi_global``.

    Source: Hirschmüller, "Stereo processing by semiglobal matching and mutual information", PAMI 2008.
    """
    left, right = gray_views(inputs["images"])
    return {
        "dense": match_semi_global(left, right, params, checked=False),
        "disparity": match_semi_global(left, right, params, checked=True),
    }
