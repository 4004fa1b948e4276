import numpy as np
import pytest

from semidense.pipeline.figures.colours import ERROR_COLOURS, ERROR_LABELS, error_classes


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        pytest.param(0.0, 0, id="right"),
        pytest.param(0.5, 0, id="at a threshold is not above it"),
        pytest.param(1.5, 2, id="between"),
        pytest.param(4.5, 4, id="far off"),
        pytest.param(np.inf, 4, id="endless"),
    ],
)
def test_classes_follow_the_thresholds(error: float, expected: int) -> None:
    assert error_classes(np.array([error])).tolist() == [expected]


def test_every_class_has_a_name_and_a_colour() -> None:
    assert len(ERROR_COLOURS) == len(ERROR_LABELS) == len(set(ERROR_COLOURS)) == 5
