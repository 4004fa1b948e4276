from typing import Any

import numpy as np
import pytest

from semidense.pipeline.api import Task, sweep_request
from semidense.pipeline.plan.errors import UsageError
from tests.tiny import SPEC


@pytest.mark.parametrize(
    "over",
    [
        pytest.param("channels.rank_window=15,31", id="one text"),
        pytest.param(iter(["channels.rank_window=15,31"]), id="a generator"),
        pytest.param({"channels.rank_window": np.array([15, 31])}, id="an array of values"),
        pytest.param({"channels.rank_window": (window for window in (15, 31))}, id="generated values"),
        pytest.param({"channels.rank_window": {15: "", 31: ""}.keys()}, id="a set of values"),
    ],
)
def test_what_is_swept_may_be_given_in_every_way(over: Any) -> None:  # noqa: ANN401
    windows = [config.channels.rank_window for config in sweep_request(Task(SPEC), 0.5, over).configs.values()]
    assert windows == [15, 31]


def test_a_sweep_over_nothing_is_one_variant_and_over_no_value_none() -> None:
    assert len(sweep_request(Task(SPEC), 0.5, None).configs) == 1
    with pytest.raises(UsageError, match=r"^costvolume\.mode has no value to try"):
        sweep_request(Task(SPEC), 0.5, {"costvolume.mode": []})
    with pytest.raises(UsageError, match=r"^over = 3: give a text"):
        sweep_request(Task(SPEC), 0.5, 3)  # type: ignore[arg-type]
