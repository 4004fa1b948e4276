import numpy as np
import pytest
from pydantic import ValidationError

from semidense.stages.evaluation.declaration import EvaluationNetParams
from semidense.stages.learning.schedule import Schedule
from semidense.stages.matching.declaration import MatchingNetParams


def rates(**settings: float) -> np.ndarray:
    schedule = Schedule(peak_rate=0.004, last_rate=0.0001, **settings)
    return np.array([schedule.rate(step) for step in range(schedule.steps)])


def test_without_a_warm_up_the_rate_falls_from_the_peak_to_the_last_along_a_cosine() -> None:
    made = rates(steps=11, warm_up=0)
    assert made[0] == 0.004 and made[-1] == pytest.approx(0.0001)
    assert made[5] == pytest.approx((0.004 + 0.0001) / 2), "half way the mean"
    assert (np.diff(made) < 0).all()


def test_in_the_warm_up_the_rate_rises_in_proportion() -> None:
    made, falling = rates(steps=100, warm_up=0.1), rates(steps=100, warm_up=0)
    assert np.allclose(made[:10] / falling[:10], np.arange(1, 11) / 10)
    assert np.array_equal(made[10:], falling[10:])


def test_a_single_step_has_the_peak_rate() -> None:
    assert rates(steps=1) == [0.004]


@pytest.mark.parametrize("warm_up", [-0.1, 1.0])
def test_refuses_a_warm_up_of_all_steps(warm_up: float) -> None:
    with pytest.raises(ValidationError, match="warm_up"):
        Schedule(warm_up=warm_up)


@pytest.mark.parametrize("section", [Schedule, MatchingNetParams, EvaluationNetParams])
def test_how_often_a_checkpoint_is_kept_is_in_no_key(section: type[Schedule]) -> None:
    often, seldom = section(checkpoint_steps=1), section(checkpoint_steps=100)
    assert "checkpoint_steps" not in often.model_dump()
    assert often.model_dump() == seldom.model_dump()
    assert {"steps", "optimiser", "peak_rate", "last_rate", "warm_up", "clip"} <= set(often.model_dump())


@pytest.mark.parametrize("field", ["steps", "peak_rate", "last_rate", "clip", "checkpoint_steps"])
def test_refuses_zero(field: str) -> None:
    with pytest.raises(ValidationError, match=field):
        Schedule.model_validate({field: 0})
