from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from semidense.pipeline.pages.viewer.pixel import CostCurve, evaluation_patch, matching_patches, window


class Counted:
    """An array that remembers what was read of it."""

    def __init__(self, values: NDArray[Any]) -> None:
        self.values, self.shape, self.read = values, values.shape, 0

    def __getitem__(self, place: object) -> NDArray[Any]:
        part = np.asarray(self.values[place])  # type: ignore[index]
        self.read += part.size
        return part


@pytest.mark.parametrize(
    ("costs", "winner", "runner_up"),
    [
        pytest.param([3, 1, 2, 0, 5], 3, 1, id="two valleys"),
        pytest.param([np.nan, 1, 2, 3, 4], 1, None, id="one valley"),
        pytest.param([np.nan] * 5, None, None, id="no cost"),
    ],
)
def test_the_minima_are_marked(costs: list[float], winner: int | None, runner_up: int | None) -> None:
    volume = np.full((2, 3, 5), np.nan, np.float16)
    volume[1, 2] = costs
    curve = CostCurve.read(volume, np.arange(-2, 3), 1, 2)
    assert (curve.winner, curve.runner_up) == (winner, runner_up)
    np.testing.assert_array_equal(curve.costs, np.array(costs, np.float32))


def test_only_the_pixel_s_costs_are_read() -> None:
    volume = Counted(np.zeros((40, 50, 7), np.float16))
    CostCurve.read(volume, np.arange(7), 3, 4)
    assert volume.read == 7


@pytest.mark.parametrize(("y", "x"), [(0, 0), (11, 19), (5, 7), (5, -30), (5, 60)])
def test_a_window_is_that_of_the_continued_image(y: int, x: int) -> None:
    image = np.random.default_rng(0).random((12, 20))
    padded = np.pad(image, 100, mode="edge")
    expected = padded[100 + y - 5 : 100 + y + 6, 100 + x - 5 : 100 + x + 6]
    np.testing.assert_array_equal(window(image, y, x, 5), expected)


def test_a_window_reads_no_more_than_itself() -> None:
    image = Counted(np.zeros((400, 400)))
    window(image, 200, 200, 5)
    assert image.read == 121


def test_the_right_patch_lies_at_the_disparity() -> None:
    channels = np.random.default_rng(0).random((2, 3, 30, 40)).astype(np.float32)
    left, right = matching_patches(channels, 15, 20, 6.4)
    np.testing.assert_array_equal(left, channels[0, :, 10:21, 15:26])
    np.testing.assert_array_equal(right, channels[1, :, 10:21, 9:20])


def test_the_evaluation_patch_is_gray_and_disparity() -> None:
    view = np.full((30, 40, 3), 7, np.uint8)
    disparity = np.arange(1200, dtype=np.float32).reshape(30, 40)
    gray, seen = evaluation_patch(view, disparity, 4, 5)
    assert (gray.shape, seen.shape) == ((101, 101), (101, 101))
    assert set(gray.ravel().tolist()) == {7}
    assert seen[50, 50] == disparity[4, 5]
