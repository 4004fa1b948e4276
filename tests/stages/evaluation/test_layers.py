import numpy as np
import pytest

from semidense.stages.evaluation.layers import evaluation_layers
from semidense.stages.stage import StageError

N = np.nan


def test_by_hand() -> None:
    left = np.array([[10, 20], [30, 40]], np.uint8)
    made = evaluation_layers(left, np.array([20.0, 10.0]), np.float32([[5, -10], [N, 0]]))
    assert made.shape == (2, 2, 2) and made.dtype == np.float32
    assert made[0].tolist() == [[-1, 0], [1, 2]]
    assert made[1].tolist() == [[1, -2], [0, 0]], "in units of 5 px; no disparity counts as 0"


def test_a_constant_view_is_zero() -> None:
    made = evaluation_layers(np.full((3, 4), 9, np.uint8), np.array([9.0, 0.0]), np.zeros((3, 4), np.float32))
    assert not made.any()


@pytest.mark.parametrize(
    "left",
    [
        pytest.param(np.full((2, 3, 1), 80, np.uint8), id="one band"),
        pytest.param(np.full((2, 3, 3), 80, np.uint8), id="colour"),
        pytest.param(np.full((2, 3), 80 * 257, np.uint16), id="16 bits"),
    ],
)
def test_any_image_is_made_gray(left: np.ndarray) -> None:
    made = evaluation_layers(left, np.array([70.0, 5.0]), np.zeros((2, 3), np.float32))
    assert (made[0] == 2).all()


def test_refuses_a_map_of_another_size() -> None:
    with pytest.raises(StageError, match=r"the left view has \(2, 3\) px, its disparity map \(3, 2\)") as error:
        evaluation_layers(np.zeros((2, 3), np.uint8), np.array([0.0, 1.0]), np.zeros((3, 2), np.float32))
    assert "\n" not in str(error.value)
