"""Every other reading of a map is told, and a map that is read right is left alone."""

from collections.abc import Callable

import numpy as np
import pytest

from semidense.stages.evaluation.evidence.foreign.misreading import misreading

SIDE = 96
RNG = np.random.default_rng(0)
RIGHT = RNG.integers(0, 256, (SIDE, SIDE), np.uint8)
TRUE = np.full((SIDE, SIDE), 3, np.float32)
TRUE[:30] = 9
TRUE[40:, 50:] = 16
LEFT = np.take_along_axis(RIGHT, (np.arange(SIDE) - TRUE.astype(int)).clip(0), axis=1)
OF_RIGHT = np.full((SIDE, SIDE), np.nan, np.float32)
for y, x in np.ndindex(TRUE.shape):
    if x - TRUE[y, x] >= 0:
        OF_RIGHT[y, int(x - TRUE[y, x])] = TRUE[y, x]


@pytest.mark.parametrize("share", [1.0, 0.5, 0.2])
def test_a_map_that_is_read_right_is_left_alone(share: float) -> None:
    """Even if most of it is wrong."""
    noise = RNG.uniform(0, 20, TRUE.shape).astype(np.float32)
    assert misreading(LEFT, RIGHT, np.where(RNG.random(TRUE.shape) < share, TRUE, noise)) is None


@pytest.mark.parametrize(
    ("misread", "told"),
    [
        pytest.param(lambda d: d[::-1], "upside down", id="rows from the bottom, as in a PFM"),
        pytest.param(lambda d: d[:, ::-1], "mirrored", id="mirrored"),
        pytest.param(lambda d: d[::-1, ::-1], "180 degrees", id="turned"),
        pytest.param(lambda d: d.T, "transposed", id="columns before rows"),
        pytest.param(lambda d: d / 2, "twice as large", id="half the scale"),
        pytest.param(lambda d: d * 2, "half as large", id="twice the scale"),
        pytest.param(lambda d: d * 16, "16 times smaller", id="OpenCV's numbers"),
        pytest.param(lambda d: -d, "the other sign", id="sign"),
        pytest.param(lambda _: OF_RIGHT, "belongs to the right view", id="of the right view"),
    ],
)
def test_a_misread_map_is_told(misread: Callable[[np.ndarray], np.ndarray], told: str) -> None:
    line = misreading(LEFT, RIGHT, misread(TRUE))
    assert line is not None and told in line and "\n" not in line


def test_views_that_were_exchanged_are_told() -> None:
    line = misreading(RIGHT, LEFT, TRUE)
    assert line is not None and line.endswith("less if left and right are exchanged")


def test_a_map_without_any_disparity_is_left_alone() -> None:
    assert misreading(LEFT, RIGHT, np.full(TRUE.shape, np.nan, np.float32)) is None
