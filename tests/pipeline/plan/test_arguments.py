import numpy as np
import pytest

from semidense.pipeline.plan.arguments import require_flag, require_number, require_workers, texts
from semidense.pipeline.plan.errors import UsageError


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        pytest.param(None, (), id="nothing"),
        pytest.param("disparity", ("disparity",), id="one text is no list of letters"),
        pytest.param(["a", "b"], ("a", "b"), id="a list"),
        pytest.param(iter(["a", "b"]), ("a", "b"), id="a generator"),
    ],
)
def test_one_text_or_several_are_taken(given: object, expected: tuple[str, ...]) -> None:
    assert texts("scenes", given) == expected


@pytest.mark.parametrize("given", [3, [3], [("semidense.R", 0.8)], b"ab", [None]], ids=repr)
def test_what_is_no_text_is_refused(given: object) -> None:
    with pytest.raises(UsageError, match=r"^scenes = .*: give a text, or a list of texts$"):
        texts("scenes", given)


@pytest.mark.parametrize("given", [1, 0.5, np.float32(0.5), np.int64(3), float("inf")], ids=repr)
def test_a_number_is_taken_as_it_is(given: float) -> None:
    assert require_number("R", given) is given


@pytest.mark.parametrize("given", [True, np.True_, "0.5", None, float("nan"), np.ones((2, 2))], ids=str)
def test_what_is_no_number_is_refused_in_one_line(given: object) -> None:
    with pytest.raises(UsageError, match=r"^R = [^\n]*: give a number$"):
        require_number("R", given)


@pytest.mark.parametrize("given", ["false", 1, 0, None], ids=repr)
def test_a_text_is_no_flag(given: object) -> None:
    for flag in (True, np.False_):
        require_flag("fill", flag)
    with pytest.raises(UsageError, match=r"^fill = .*: give True or False$"):
        require_flag("fill", given)


@pytest.mark.parametrize("given", [-1, 0, "2", 1.5, True, [2]], ids=repr)
def test_workers_are_a_whole_number_from_1(given: object) -> None:
    for known in (None, 1, np.int64(2)):
        require_workers(known)
    with pytest.raises(UsageError, match=r"^workers = .*: give a whole number from 1"):
        require_workers(given)
