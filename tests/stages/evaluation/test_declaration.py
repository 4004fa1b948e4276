import pytest
from pydantic import ValidationError

from semidense.stages.evaluation.declaration import (
    CONFIDENCE,
    PATCH,
    RADIUS,
    ConfidenceParams,
    EvaluationNetParams,
    EvaluationSamplesParams,
)


def test_a_patch_has_a_centre() -> None:
    assert PATCH == 2 * RADIUS + 1 == 101
    assert CONFIDENCE.halo(ConfidenceParams()) == RADIUS
    assert CONFIDENCE.border == "edge"


def test_the_papers_tolerance_is_the_default() -> None:
    assert EvaluationSamplesParams().tolerance == 1.0


@pytest.mark.parametrize(
    ("section", "field", "message"),
    [
        pytest.param(EvaluationSamplesParams, {"tolerance": 0}, "greater than 0", id="nothing is exact"),
        pytest.param(EvaluationSamplesParams, {"rows": 0}, "greater than or equal to 1", id="empty grid"),
        pytest.param(EvaluationSamplesParams, {"form": "dense"}, "'strided' or 'patch'", id="unknown form"),
        pytest.param(EvaluationNetParams, {"batch": 5}, "multiple of 2", id="shards of different sizes"),
        pytest.param(EvaluationNetParams, {"relight": -1}, "greater than or equal to 0", id="negative light"),
        pytest.param(ConfidenceParams, {"precision": "half"}, "'float32' or 'bfloat16'", id="unknown precision"),
        pytest.param(ConfidenceParams, {"R": 0.5}, "Extra inputs are not permitted", id="a field of another section"),
    ],
)
def test_refuses(section: type, field: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        section.model_validate(field)
