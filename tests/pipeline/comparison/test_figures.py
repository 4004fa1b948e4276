import numpy as np
import pytest

from semidense.pipeline.comparison.figures import lighting_difference, untextured_share


@pytest.mark.parametrize(
    ("gray", "share"),
    [
        pytest.param(np.full((4, 5), 9), 1, id="flat"),
        pytest.param(np.arange(20).reshape(4, 5) * 9, 0, id="steep"),
        pytest.param(np.tile([0, 2, 4, 90, 92], (4, 1)), 0.75, id="one edge of four steps"),
    ],
)
def test_texture_is_a_step_between_neighbours(gray: np.ndarray, share: float) -> None:
    assert untextured_share({"left": gray.astype(np.uint8)}) == share


def test_lighting_is_the_difference_of_the_mean_grays() -> None:
    assert lighting_difference({"moments": np.array([[100.0, 9], [130, 4]])}) == 30
