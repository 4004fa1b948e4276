import pytest

from semidense.stages.stage import StageError
from semidense.stages.transforms.window import require_window


@pytest.mark.parametrize("window", [3, 31, 61])
def test_returns_a_good_window(window: int) -> None:
    assert require_window(window) == window


@pytest.mark.parametrize("window", [2, 1, 0, -1, 60])
def test_refuses_the_rest(window: int) -> None:
    with pytest.raises(StageError, match=f"window is {window} px"):
        require_window(window)
