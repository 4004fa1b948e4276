import pickle

import pytest

from semidense.cache import CacheError
from semidense.datasets import DatasetError
from semidense.pipeline.plan.errors import USER_ERRORS, PipelineError, StageFailed, StageRefused, UsageError
from semidense.stages.stage import StageError


@pytest.mark.parametrize("kind", [UsageError, StageRefused, DatasetError, CacheError, StageError])
def test_what_a_user_can_mend_is_one_line(kind: type[Exception]) -> None:
    assert issubclass(kind, USER_ERRORS)


def test_a_fault_of_a_stage_is_none_of_these() -> None:
    assert not issubclass(StageFailed, USER_ERRORS)


@pytest.mark.parametrize(
    ("kind", "builtin"), [(UsageError, ValueError), (StageRefused, ValueError), (StageFailed, RuntimeError)]
)
def test_each_is_also_the_builtin_that_a_caller_would_catch(kind: type[Exception], builtin: type[Exception]) -> None:
    assert issubclass(kind, builtin)
    assert issubclass(kind, PipelineError)


@pytest.mark.parametrize("kind", [UsageError, StageRefused, StageFailed])
def test_an_error_survives_the_way_from_another_process(kind: type[Exception]) -> None:
    back = pickle.loads(pickle.dumps(kind("one line")))
    assert (type(back), str(back)) == (kind, "one line")
