import numpy as np
import pytest

from semidense.stages.evaluation.evidence.overlap import LARGEST, overlap
from semidense.stages.stage import StageError

N = np.nan


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        pytest.param([0, 0, 0, 0], [0, 0, 0, 0], id="one surface"),
        pytest.param([0, 0, 0, 2, 0], [0, 2, 0, 0, 0], id="a nearer pixel hides the one that it covers"),
        pytest.param([1, 1, 1], [LARGEST, 0, 0], id="beyond the left border"),
        pytest.param([0, -1, 0], [0, 1, 0], id="a negative disparity lies behind"),
        pytest.param([0, N, 0, 2], [0, N, 0, 0], id="no disparity covers nothing"),
        pytest.param([0, 0, 0.4, 1.6], [0, 1.6, 0, 0], id="columns are rounded to the nearest"),
    ],
)
def test_hand_values(row: list[float], expected: list[float]) -> None:
    np.testing.assert_allclose(overlap(np.float32([row, row])), np.float32([expected, expected]), rtol=1e-6)


def test_a_volume_is_refused() -> None:
    with pytest.raises(StageError, match="expected 2 dimensions"):
        overlap(np.zeros((2, 2, 2), np.float32))
