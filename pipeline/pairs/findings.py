"""Say in words what a look at a pair (the product ``survey``) found wrong with it."""

from collections.abc import Iterator, Mapping

import numpy as np

from semidense.datasets import Calibration, DisparityRange
from semidense.stages.disparity.survey import ENOUGH, FIELDS, PATCH, REACH, side_by_side
from semidense.stages.stage import Array

_EQUAL = 0.99
_NEARLY_ALL = 0.9
_TAIL = 15
_SILENT = 0.01
_BEYOND = 0.05
"""Share of the matches outside the range that was searched from which on it is told; stray ones are fewer."""
_LEAST_OFFSET = 1.0
"""A vertical offset below this does no harm: a patch is 11 px high."""
_LEVEL = 2
"""Steps of the survey up to which a match counts as level."""
_NEAR = 0.15
"""Share of the width within which a match has about the median disparity."""
_AGREEING = 0.4
"""Least share of the matches that are level and near the median: of 189 pairs of benchmarks the least had 0.75; of
pairs that were mirrored, turned, or had rows 20 to 40 px off, at most 0.27."""
_APART = 25
"""Squares that matches must lie in before they are said to contradict each other: patches that overlap err alike."""


def findings(
    survey: Mapping[str, Array],
    searched: DisparityRange | None,
    known: Calibration | None = None,
    *,
    aligned: bool = False,
    estimated: bool = False,
) -> list[str]:
    """Return one line for each problem of a pair; an empty list for a sound pair.

    Args:
        survey: the product's arrays.
        searched: the range of disparities that was searched; None if it is not known.
        known: the pair's calibration: a point at infinity has the disparity ``-doffs``.
        aligned: the rows of the right view are shifted for the matching.
        estimated: whether an end of the range was estimated.
    """
    if same := same_picture(float(survey["equal"][0])):
        return same
    matches = dict(zip(FIELDS, survey["matches"].T, strict=True))
    if matches["y"].size < ENOUGH:
        return [f"only {matches['y'].size} places agree between the views: are they of the same scene, and rectified?"]
    step = float(survey["step"][0])
    squares = side_by_side(survey["matches"][:, :2], PATCH * step)
    tilted = [*_unrectified(matches["vertical"], step, aligned)] if squares >= ENOUGH else []
    if not tilted and squares >= _APART and (told := _contradicting(matches, step, survey["left"].shape[1])):
        return told
    return [
        *(
            [*_exchanged(matches["disparity"], step, None if estimated else searched, known.doffs if known else 0.0)]
            or _outside(matches["disparity"], step, searched, survey["range"])
        ),
        *tilted,
    ]


def same_picture(equal: float) -> list[str]:
    """Return a line if two views are one, given the share of their pixels that are equal."""
    told = f"the two views are the same picture ({100 * equal:.1f} % of their pixels are equal)"
    return [told] if equal >= _EQUAL else []


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


def _outside(disparity: Array, step: float, searched: DisparityRange | None, likely: Array) -> Iterator[str]:
    """Warn of a range that leaves out disparities which the matches have, and not only stray ones."""
    if searched is None:
        return
    low, high = searched.minimum, searched.maximum
    left_out = (disparity < low - step) | (disparity > high + step)
    share = float(np.mean(left_out & (disparity >= likely[0]) & (disparity <= likely[1])))
    if share >= _BEYOND:
        yield (
            f"{100 * share:.0f} % of the places that agree between the views lie outside of the {low} to {high} px "
            "that were searched: there the map is wrong, and the confidence may not tell; search "
            f"{min(low, likely[0]):.0f} to {max(high, likely[1]):.0f} px"
        )


def _contradicting(matches: Mapping[str, Array], step: float, columns: int) -> list[str]:
    """Return a line if few matches are level and have similar disparities: then most are found by chance.

    Args:
        matches: arrays (match,) by field, px.
        step: px to one of the shrunken views.
        columns: of the shrunken views, px.
    """
    disparity = matches["disparity"]
    near = np.abs(disparity - np.median(disparity)) <= _NEAR * columns * step
    share = float(np.mean(near & (np.abs(matches["vertical"]) <= _LEVEL * step)))
    if share >= _AGREEING:
        return []
    return [
        f"the places that agree between the views contradict each other (only {100 * share:.0f} % of them lie level "
        f"and at similar disparities): is one view mirrored or turned, do the rows lie more than {REACH * step:g} px "
        "apart, or are they of different scenes? match needs two upright views of one scene, and rectified: "
        "`pipeline rectify LEFT RIGHT --calib STEREO_YAML`"
    ]


def _unrectified(vertical: Array, step: float, aligned: bool) -> Iterator[str]:
    low, middle, high = np.percentile(vertical, (_TAIL, 50, 100 - _TAIL))
    if abs(middle) >= max(_LEAST_OFFSET, step / 2) or high - low >= max(2 * _LEAST_OFFSET, 2 * step):
        ends = REACH * step
        more = f", or further off: the search ends at {ends:g} px" if max(-low, high) >= ends else ""
        shifted = "; its rows were shifted, so the map can be right, but its depth may be wrong" if aligned else ""
        yield (
            f"the pair looks unrectified: the right view lies {middle:+.0f} px ({low:+.0f} to {high:+.0f}, measured to "
            f"{step:g} px{more}) below the left one, where it should lie level{shifted}; rectify it first with "
            "`pipeline rectify LEFT RIGHT --calib STEREO_YAML` (docs/own-pictures.md says how to get the calibration)"
        )
