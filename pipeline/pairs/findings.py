"""Say in words what a look at a pair (the product ``survey``) found wrong with it."""

from collections.abc import Iterator, Mapping

import numpy as np

from semidense.datasets import Calibration, DisparityRange
from semidense.stages.disparity.survey import ENOUGH, FIELDS, PATCH, side_by_side
from semidense.stages.stage import Array

_EQUAL = 0.99
_NEARLY_ALL = 0.9
_TAIL = 15
_SILENT = 0.01
_LEAST_OFFSET = 1.0
"""A vertical offset below this does no harm: a patch is 11 px high."""


def findings(
    survey: Mapping[str, Array],
    searched: DisparityRange | None,
    known: Calibration | None = None,
    *,
    aligned: bool = False,
) -> list[str]:
    """Return one line for each problem of a pair; an empty list for a sound pair.

    Args:
        survey: the product's arrays.
        searched: the range of disparities that the user gave; None if an end of it is estimated.
        known: the pair's calibration: a point at infinity has the disparity ``-doffs``.
        aligned: the rows of the right view are shifted for the matching.
    """
    if survey["equal"][0] >= _EQUAL:
        return [f"the two views are the same picture ({100 * survey['equal'][0]:.1f} % of their pixels are equal)"]
    matches = dict(zip(FIELDS, survey["matches"].T, strict=True))
    if matches["y"].size < ENOUGH:
        return [f"only {matches['y'].size} places agree between the views: are they of the same scene, and rectified?"]
    step, places = float(survey["step"][0]), survey["matches"][:, :2]
    return [
        *_exchanged(matches["disparity"], step, searched, known.doffs if known else 0.0),
        *(_unrectified(matches["vertical"], step, aligned) if side_by_side(places, PATCH * step) >= ENOUGH else ()),
    ]


def without_texture(distinctiveness: Mapping[str, Array]) -> list[str]:
    """Return a line that names the share of the left view without texture along its rows; none below 1 %.

    Args:
        distinctiveness: the product's arrays.
    """
    share = float(np.mean(distinctiveness["left"] < 1))
    if share < _SILENT:
        return []
    return [
        f"{100 * share:.0f} % of the left view is blank or repeats itself along its rows: no disparity can be found "
        "there, and the confidence is 0"
    ]


def _exchanged(disparity: Array, step: float, searched: DisparityRange | None, doffs: float) -> Iterator[str]:
    if np.mean(np.abs(disparity) < step) >= _NEARLY_ALL:
        yield "the two views hardly differ: nearly all disparities are 0; are they of one camera at one place?"
        return
    negative = float(np.mean(disparity + max(0.0, doffs) <= -step))
    wanted = searched is not None and searched.minimum <= np.median(disparity)
    if negative >= _NEARLY_ALL and not wanted:
        yield (
            f"left and right look exchanged: {100 * negative:.0f} % of the disparities are negative, about "
            f"{np.median(disparity):.0f} px; give the files in the other order, or, if the cameras are turned towards "
            "each other, the smallest and the largest disparity to search"
        )


def _unrectified(vertical: Array, step: float, aligned: bool) -> Iterator[str]:
    low, middle, high = np.percentile(vertical, (_TAIL, 50, 100 - _TAIL))
    if abs(middle) >= max(_LEAST_OFFSET, step / 2) or high - low >= max(2 * _LEAST_OFFSET, 2 * step):
        shifted = "; its rows were shifted, so the map can be right, but its depth may be wrong" if aligned else ""
        yield (
            f"the pair looks unrectified: the right view lies {middle:+.0f} px ({low:+.0f} to {high:+.0f}, measured to "
            f"{step:g} px) below the left one, where it should lie level{shifted}; rectify it first with "
            "`pipeline rectify LEFT RIGHT --calib STEREO_YAML` (docs/own-pictures.md says how to get the calibration)"
        )
