import numpy as np
import pytest

from semidense.stages.disparity.declaration import FILLED
from semidense.stages.disparity.filling import fill_holes
from semidense.stages.stage import NoParams

N = np.nan


@pytest.mark.parametrize(
    ("given", "filled"),
    [
        pytest.param([[7, N, N, 3]], [[7, 3, 3, 3]], id="the farther end"),
        pytest.param([[3, N, N, 7]], [[3, 3, 3, 7]], id="whichever side it is on"),
        pytest.param([[N, 7, N]], [[7, 7, 7]], id="at the border the one end"),
        pytest.param([[-3, N, 2]], [[-3, -3, 2]], id="negative is farther"),
        pytest.param([[N, N], [1, 2], [N, N]], [[1, 2], [1, 2], [1, 2]], id="an empty row takes the nearest"),
        pytest.param([[1, 1], [N, N], [2, 2]], [[1, 1], [1, 1], [2, 2]], id="of two the upper"),
        pytest.param([[N, N]], [[N, N]], id="nothing to fill from"),
        pytest.param([[4, 5]], [[4, 5]], id="no hole"),
    ],
)
def test_by_hand(given: list[list[float]], filled: list[list[float]]) -> None:
    made = fill_holes(np.float32(given))
    assert made.dtype == np.float32
    assert np.array_equal(made, np.float32(filled), equal_nan=True)


def test_the_stage_tells_guesses_from_measurements() -> None:
    made = FILLED.function()(NoParams(), {"refined": {"disparity": np.float32([[1, N, 3]])}})
    assert made["guessed"].tolist() == [[False, True, False]]
    assert made["disparity"].tolist() == [[1, 1, 3]]
