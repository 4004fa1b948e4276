import errno
import os
import pickle

import pytest

from semidense.cache import CacheError
from semidense.datasets import DatasetError
from semidense.pipeline.plan.errors import (
    USER_ERRORS,
    PipelineError,
    StageFailed,
    StageRefused,
    UsageError,
    told,
    told_of_stage,
)
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


def caused(error: Exception, cause: Exception) -> Exception:
    error.__cause__ = cause
    return error


FULL = OSError(errno.EMFILE, os.strerror(errno.EMFILE), "left.png")


@pytest.mark.parametrize(
    ("error", "words"),
    [
        pytest.param(FULL, "too many files are open at once: raise the limit (ulimit -n)", id="a file"),
        pytest.param(
            ImportError("libgfortran.so: cannot open shared object file: Too many open files"),
            "too many files are open at once: raise the limit (ulimit -n)",
            id="a library",
        ),
        pytest.param(caused(RuntimeError("no loop"), FULL), "too many files are open at once", id="the cause"),
        pytest.param(MemoryError(), "there is not enough memory: raise its limit (ulimit -v)", id="memory"),
        pytest.param(caused(RuntimeError("no thread"), MemoryError()), "there is not enough memory", id="its cause"),
    ],
)
def test_what_the_machine_lacks_is_told_in_one_line(error: Exception, words: str) -> None:
    for tell in (told, told_of_stage):
        assert str(tell(error)).startswith(words)


def test_a_fault_of_the_program_is_not_told_in_one_line() -> None:
    assert told(RuntimeError("too many cooks")) is None
