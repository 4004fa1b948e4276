from typing import Any

import numpy as np
import pytest

from semidense.pipeline.execution.returned import require_declared, require_lengths
from semidense.stages.stage import Output, Stage, StageError

STAGE = Stage(
    product="labels",
    inputs=(),
    outputs=(Output("label", ("y", "x"), "uint8", "1", "which"), Output("any", ("n",), None, "1", "what comes")),
    compute="elsewhere:make",
)
ANY = np.zeros(3)


def test_what_is_declared_is_taken_whatever_its_type_if_the_numbers_fit() -> None:
    made = {"label": np.full((2, 4), 255, np.int64), "any": ANY}
    assert require_declared(STAGE, made) is made
    require_lengths(STAGE, made, {"y": 2, "x": 4})


@pytest.mark.parametrize(
    ("made", "message"),
    [
        pytest.param(None, "gave NoneType; a stage gives a dict", id="nothing"),
        pytest.param({"any": ANY}, "gave any; its declaration says any, label", id="one is missing"),
        pytest.param({}, "gave no array; its", id="all are missing"),
        pytest.param({"label": ANY, "any": ANY, "more": ANY}, "gave any, label, more; its", id="one too many"),
        pytest.param({"label": [[1]], "any": ANY}, r"gave list for label; expected \(y, x\)", id="a list"),
        pytest.param({"label": ANY, "any": ANY}, r"gave float64, 3 for label; expected \(y, x\)", id="dimensions"),
        pytest.param({"label": np.full((2, 4), 256), "any": ANY}, ".*says uint8, which cannot hold", id="too large"),
        pytest.param({"label": np.full((2, 4), -1), "any": ANY}, ".*says uint8, which cannot hold", id="negative"),
        pytest.param({"label": np.ones((2, 4)), "any": ANY}, ".*says uint8, which cannot hold", id="no whole numbers"),
    ],
)
def test_anything_else_is_refused(made: Any, message: str) -> None:  # noqa: ANN401
    with pytest.raises(StageError, match=f"^elsewhere:make {message}"):
        require_declared(STAGE, made)


def test_an_array_of_another_size_is_refused() -> None:
    made = {"label": np.zeros((2, 4), np.uint8), "any": ANY}
    with pytest.raises(StageError, match=r"gave uint8, 2 x 4 for label \(y, x\); x must be 5"):
        require_lengths(STAGE, made, {"y": 2, "x": 5})
