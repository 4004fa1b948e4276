import numpy as np
import pytest

from semidense.stages.disparity.aggregation.levels import CAP, NO_COST, levels_of, with_mean
from semidense.stages.stage import StageError
from tests.stages.disparity.aggregation.direct import levels

N, I = np.nan, np.inf  # noqa: E741


def row(costs: list[list[float]], d_min: int, dtype: type = np.float16) -> tuple[list, list]:
    made = levels_of(np.array([costs], dtype), d_min)
    assert made.above.dtype == made.least.dtype == np.int16
    return made.above[0].tolist(), made.least[0].tolist()


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
@pytest.mark.parametrize(
    ("costs", "above", "least"),
    [
        pytest.param([1, -2], [12, 0], -8, id="above the least, in quarters"),
        pytest.param([0, 0.2], [0, 1], 0, id="rounded"),
        pytest.param([0, 60], [0, 160], 0, id="at most 40"),
        pytest.param([N, 3], [16, 0], 12, id="a cell without a cost"),
        pytest.param([N, N], [0, 0], NO_COST, id="a pixel without any cost says nothing"),
        pytest.param([I, 3], [160, 0], 12, id="infinity is the largest"),
        pytest.param([-I, 3], [0, 160], -16384, id="minus infinity is the least"),
        pytest.param([I, I], [0, 0], 16384, id="all infinite"),
        pytest.param([-65504, 65504], [0, 160], -16384, id="the ends of float16"),
    ],
)
def test_by_hand(costs: list[float], above: list[int], least: int, dtype: type) -> None:
    # Between two pixels that make the range's right pixels, x - d for d = -1 and 0, lie inside the image.
    made, low = row([costs, [0, 0]], -1, dtype)
    assert made[0] == above and low[0] == least


@pytest.mark.parametrize(
    ("d_min", "expected"),
    [
        pytest.param(0, [[0, 0, 0], [8, 0, 4], [0, 8, 16]], id="at the left border"),
        pytest.param(-2, [[0, 8, 16], [8, 0, 16], [0, 0, 0]], id="at the right border"),
        pytest.param(7, [[0, 8, 16], [8, 0, 16], [0, 8, 16]], id="no right pixel is in the image"),
    ],
)
def test_a_cell_outside_the_image_has_the_mean_of_the_others(d_min: int, expected: list[list[int]]) -> None:
    costs = np.float16([[[0, 2, 4], [2, 0, 4], [0, 2, 4]]])
    right = np.arange(3)[:, None] - np.arange(d_min, d_min + 3)
    costs[:, (right < 0) | (right >= 3)] = N
    if d_min == 7:
        costs = np.float16([[[0, 2, N], [2, 0, N], [0, 2, 4]]])
    assert row(costs[0].tolist(), d_min)[0] == expected


def test_every_float16_has_its_level() -> None:
    every = np.arange(1 << 16, dtype=np.uint16).view(np.float16)
    finite = every[np.abs(every) < 20]
    costs = np.stack([finite, np.zeros_like(finite)], 1)[None]
    assert levels_of(costs, -len(finite)).above.tolist() == levels(costs, -len(finite))


@pytest.mark.parametrize(
    ("costs", "message"),
    [
        pytest.param(np.zeros((2, 3), np.float16), "has shape", id="two dimensions"),
        pytest.param(np.zeros((2, 3, 4)), "float64", id="another dtype"),
    ],
)
def test_what_is_no_volume_is_refused(costs: np.ndarray, message: str) -> None:
    with pytest.raises(StageError, match=message):
        levels_of(costs, 0)


def test_a_second_pass_adds_the_mean_of_the_paths_above_the_least() -> None:
    above = np.int16([[[0, 10, 320]]])
    sums = np.uint16([[[100, 103, 104]]])
    # Of 8 paths the means above the least are 0, 3 / 8 and a half, which is rounded up.
    assert with_mean(above, sums, 8).tolist() == [[[0, 10, 321]]]
    assert with_mean(above, sums * 100, 16).tolist() == [[[0, 29, 345]]]


def test_a_second_pass_adds_at_most_the_largest_cost() -> None:
    made = with_mean(np.int16([[[CAP, 0]]]), np.uint16([[[16 * (2 * CAP + 3200), 0]]]), 16)
    assert made.tolist() == [[[2 * CAP, 0]]]
