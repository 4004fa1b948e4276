import numpy as np
import pytest
from pydantic import ValidationError

from stages.evaluation.declaration import EvaluationNetParams
from stages.matching.declaration import MatchingNetParams
from stages.schedule import Schedule


def test_the_rate_falls_from_the_first_to_the_last_by_one_factor() -> None:
    schedule = Schedule(steps=11, first_rate=0.002, last_rate=0.0001)
    rates = [schedule.rate(step) for step in range(11)]
    assert rates[0] == pytest.approx(0.002) and rates[-1] == pytest.approx(0.0001)
    assert np.ptp(np.divide(rates[1:], rates[:-1])) < 1e-12
    assert rates[5] == pytest.approx((0.002 * 0.0001) ** 0.5), "half way the geometric mean"


def test_a_single_step_has_the_first_rate() -> None:
    assert Schedule(steps=1, first_rate=0.3).rate(0) == 0.3


def test_the_papers_rates_are_the_default() -> None:
    assert (Schedule().first_rate, Schedule().last_rate) == (0.002, 0.0001)


@pytest.mark.parametrize("section", [Schedule, MatchingNetParams, EvaluationNetParams])
def test_how_often_a_checkpoint_is_kept_is_in_no_key(section: type[Schedule]) -> None:
    often, seldom = section(checkpoint_steps=1), section(checkpoint_steps=100)
    assert "checkpoint_steps" not in often.model_dump()
    assert often.model_dump() == seldom.model_dump()
    assert {"steps", "first_rate", "last_rate", "clip"} <= set(often.model_dump())


@pytest.mark.parametrize("field", ["steps", "first_rate", "last_rate", "clip", "checkpoint_steps"])
def test_refuses_zero(field: str) -> None:
    with pytest.raises(ValidationError, match=field):
        Schedule.model_validate({field: 0})
