from typing import Any

import numpy as np
import pytest

from semidense.pipeline.api import Task
from semidense.pipeline.pairs.match import match
from semidense.pipeline.pairs.wishes import Wishes, with_wishes
from semidense.pipeline.plan.errors import UsageError


@pytest.mark.parametrize(
    ("wishes", "message"),
    [
        pytest.param({"fill": "false"}, "fill = 'false': give True or False", id="a text is no flag"),
        pytest.param({"calibrated": 1}, "calibrated = 1: give True or False", id="a number is no flag"),
        pytest.param({"R": True}, "R = True: give a number", id="a flag is no number"),
        pytest.param({"density": "0.5"}, "density = '0.5': give a number", id="a text is no number"),
        pytest.param({"R": float("nan")}, "R = nan: give a number", id="NaN"),
        pytest.param({"within": 1.0}, "within says what", id="within alone"),
        pytest.param({"tolerance": 0.01}, "tolerance says what left_right drops", id="a tolerance alone"),
    ],
)
def test_wishes_without_effect_or_of_another_type_are_refused(wishes: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        Wishes(**wishes)


def test_numpys_flags_and_numbers_are_wishes() -> None:
    found = Wishes(R=np.float32(0.5), fill=np.True_, left_right=np.False_)  # type: ignore[arg-type]
    assert (found.settings, found.product) == (("semidense.R=0.5",), "filled")


def test_without_a_tolerance_that_of_the_settings_holds() -> None:
    assert Wishes(left_right=True).settings == ("refined.left_right=true",)
    assert "refined.tolerance=2" in Wishes(left_right=True, tolerance=2).settings


@pytest.mark.parametrize("instead", ["density", "max_error"])
def test_a_threshold_that_the_settings_replace_is_refused(instead: str) -> None:
    task = Task(settings={f"semidense.{instead}": 0.5})
    with pytest.raises(UsageError, match=r"^R = 0\.2 says how much to keep, and so does .*; give one of them$"):
        with_wishes(task, Wishes(R=0.2))
    assert with_wishes(task, Wishes(fill=True)).settings == task.settings
    assert with_wishes(task.and_settings(f"semidense.{instead}=null"), Wishes(R=0.2)).settings[-1] == "semidense.R=0.2"


@pytest.mark.parametrize(
    ("wrong", "hint"), [("r", "did you mean R?"), ("scheduler", "there are d_min, d_max, calib"), ("filled", "fill?")]
)
def test_an_unknown_wish_is_told_with_the_nearest(wrong: str, hint: str) -> None:
    with pytest.raises(UsageError) as refused:
        match("left.png", "right.png", **{wrong: 0.5})
    assert str(refused.value).startswith(f"match has no parameter '{wrong}'; ") and hint in str(refused.value)
