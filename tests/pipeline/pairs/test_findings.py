import re

import numpy as np
import pytest

from semidense.datasets import Calibration, DisparityRange
from semidense.pipeline.pairs.findings import findings, without_texture
from semidense.stages.disparity.survey import ENOUGH


def survey(
    disparity: object, vertical: object = 0, *, count: int = 1000, equal: float = 0.1, step: int = 1
) -> dict[str, np.ndarray]:
    matches = np.zeros((count, 4), np.float32)
    matches[:, 0], matches[:, 1] = 40 * step * (np.arange(count) // 40), 20 * step * (np.arange(count) % 40)
    matches[:, 2], matches[:, 3] = disparity, vertical
    likely = matches[:, 2].min(), matches[:, 2].max()
    return {
        "matches": matches,
        "equal": np.array([equal]),
        "step": np.array([step]),
        "range": np.array(likely),
        "left": np.zeros((500 // step, 800 // step), np.uint8),
    }


RAMP = np.linspace(-1, 1, 1000)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        pytest.param(survey(20 + 5 * RAMP), None, id="a sound pair"),
        pytest.param(survey(20, np.where(RAMP > 0.8, 3, 0)), None, id="a few stray rows"),
        pytest.param(survey(3 * RAMP), None, id="both signs, as of turned cameras"),
        pytest.param(survey(0, equal=1.0), "the same picture", id="one picture twice"),
        pytest.param(survey(0.2 * RAMP), "hardly differ", id="a camera that stood still"),
        pytest.param(survey(-20), "exchanged", id="left for right"),
        pytest.param(survey(20, 4), r"unrectified: the right view lies \+4 px", id="one camera lower"),
        pytest.param(survey(20, 4), "`pipeline rectify LEFT RIGHT --calib", id="the command that helps"),
        pytest.param(survey(20, 6 * RAMP), r"\(-4 to \+4, measured to 1 px\)", id="one camera turned"),
        pytest.param(survey(20, 1, step=6), None, id="less than can be measured"),
        pytest.param(survey(20, count=ENOUGH - 1), "only 99 places agree", id="nothing in common"),
    ],
)
def test_what_looks_wrong_is_said_in_one_line(found: dict[str, np.ndarray], expected: str | None) -> None:
    said = findings(found, None)
    assert len(said) == (expected is not None)
    if expected:
        assert "\n" not in said[0]
        with pytest.raises(ValueError, match=expected):
            raise ValueError(said[0])


def test_matches_of_the_same_few_places_tell_nothing_of_the_rows() -> None:
    """In a picture of 64 x 64 px hundreds of patches overlap, and the wrong ones among them overlap as well."""
    small = survey(20, 6 * RAMP)
    small["matches"][:, :2] /= 16
    assert findings(small, None) == []


CHANCE = np.random.default_rng(0).uniform(-1, 1, (2, 1000))
"""What matches that are found by chance have in common: nothing."""


@pytest.mark.parametrize("squares", [50, 1000])
@pytest.mark.parametrize(
    ("disparity", "vertical", "contradict"),
    [
        pytest.param(20 + 5 * RAMP, CHANCE[0], False, id="a sound pair with little texture"),
        pytest.param(20 + 90 * RAMP, 0, False, id="near and far things"),
        pytest.param(600 * CHANCE[0], CHANCE[1], True, id="one view mirrored: all disparities"),
    ],
)
def test_matches_that_contradict_each_other_are_told(
    disparity: object, vertical: object, contradict: bool, squares: int
) -> None:
    found = survey(disparity, vertical)
    found["matches"][:, :2] = found["matches"][np.arange(1000) % squares, :2]
    said = findings(found, DisparityRange(-600, 600))
    assert len(said) == contradict
    assert all("contradict each other" in line and "mirrored" in line and "\n" not in line for line in said)


def test_few_matches_that_are_not_level_are_told() -> None:
    """Rows lie further apart than the survey searches: only some matches are found, all over the rows it searched."""
    found = survey(20, 8 * CHANCE[0])
    found["matches"][:, :2] = found["matches"][np.arange(1000) % 50, :2]
    (line,) = findings(found, None)
    assert "contradict each other" in line and "more than 8 px apart" in line


@pytest.mark.parametrize(("step", "vertical", "told"), [(1, 8, True), (1, -8, True), (1, 7, False), (2, 8, False)])
def test_an_offset_at_the_end_of_the_search_may_be_larger(step: int, vertical: float, told: bool) -> None:
    (line,) = findings(survey(20, vertical, step=step), None)
    assert ("or further off: the search ends at 8 px" in line) == told


def test_rows_that_were_shifted_are_told() -> None:
    (alone,), (aligned,) = (findings(survey(20, 4), None, aligned=each) for each in (False, True))
    assert "its rows were shifted" in aligned and "its rows were shifted" not in alone
    assert findings(survey(20, 0.4), None, aligned=True) == []


@pytest.mark.parametrize(
    ("low", "high", "told"),
    [
        (0, 30, None),
        (16, 24, None),  # a step more at each end is no surprise
        (0, 20, "40 % of the places that agree between the views lie outside of the 0 to 20 px .* search 0 to 25 px"),
        (22, 60, "60 % .* outside of the 22 to 60 px .* search 15 to 60 px"),
        (0, 2, "100 % .* search 0 to 25 px"),
    ],
)
@pytest.mark.parametrize("estimated", [False, True])
def test_a_range_that_leaves_out_what_matches_is_told(low: int, high: int, told: str | None, estimated: bool) -> None:
    said = findings(survey(20 + 5 * RAMP), DisparityRange(low, high), estimated=estimated)
    assert len(said) == (told is not None)
    if told:
        assert re.match(told, said[0])


def test_stray_matches_outside_the_range_are_no_surprise() -> None:
    stray = survey(np.where(RAMP > 0.8, 90, 20))
    stray["range"] = np.array([15, 25])  # the look at the pair found them too lonely
    assert findings(stray, DisparityRange(0, 30)) == []


@pytest.mark.parametrize(("low", "warned"), [(-30, False), (0, True)])
def test_negative_disparities_that_were_asked_for_are_no_surprise(low: int, warned: bool) -> None:
    assert bool(findings(survey(-20), DisparityRange(low, 30))) == warned


@pytest.mark.parametrize(
    ("doffs", "warned"),
    [
        pytest.param(0, True, id="cameras that look straight ahead: beyond infinity"),
        pytest.param(31, False, id="principal points 31 px apart: a point at infinity has -31 px"),
        pytest.param(5, True, id="5 px apart do not explain -20 px"),
    ],
)
def test_negative_disparities_that_the_calibration_explains_are_no_surprise(doffs: float, warned: bool) -> None:
    assert bool(findings(survey(-20), None, Calibration(500, 120, doffs))) == warned


def test_the_way_out_of_negative_disparities_is_not_only_to_exchange_the_views() -> None:
    (warning,) = findings(survey(-20), None)
    assert "if the cameras are turned towards each other, the smallest and the largest disparity" in warning


def test_the_share_without_texture_is_named_from_one_per_cent_on() -> None:
    views = {"left": np.full((10, 20), 3.0), "right": np.zeros((10, 20))}
    assert without_texture(views) == []
    views["left"][0, 0] = 0.5
    assert without_texture(views) == []
    views["left"][:5] = 0.5
    (line,) = without_texture(views)
    assert line.startswith("50 % of the left view")
