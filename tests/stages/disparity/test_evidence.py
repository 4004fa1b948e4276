import numpy as np
import pytest

from semidense.stages.disparity.aggregation.levels import levels_of
from semidense.stages.disparity.aggregation.strips import Strip
from semidense.stages.disparity.aggregation.winner import winner
from semidense.stages.disparity.evidence import FEATURES, evidence

N = np.nan
PATHS = 8


def features(costs: list[list[float]], sums: list[list[float]], d_min: int = 0) -> dict[str, list[float]]:
    """Return the features of a row of pixels, from single costs and from aggregated costs a path."""
    single = levels_of(np.array([costs], np.float16), d_min)
    summed = (np.array([sums]) * 4 * PATHS).astype(np.uint16)
    strip = Strip(slice(0, 1), single, summed, summed)
    made = evidence(strip, winner(strip), PATHS)
    assert made.dtype == np.float32 and made.shape == (len(FEATURES), 1, len(costs))
    return {name: values[0].tolist() for name, values in zip(FEATURES, made, strict=True)}


def last(costs: list[float], sums: list[float]) -> dict[str, float]:
    """Return the features of the last pixel of a row of six that are all alike."""
    return {name: values[-1] for name, values in features([costs] * 6, [sums] * 6).items()}


@pytest.mark.parametrize(
    ("costs", "sums", "feature", "expected"),
    [
        pytest.param([9] * 5, [5, 9, 2, 3, 4], "aggregated_margin", 2, id="neighbours of the winner are left out"),
        pytest.param([9] * 3, [5, 2, 3], "aggregated_margin", 40, id="there is no other minimum"),
        pytest.param([3, 5, 9, 0, 1], [9] * 5, "single_margin", 3, id="of the single costs' own winner"),
        pytest.param([N, 5, 0, 1, N], [9] * 5, "single_margin", 4, id="cells without a cost are 4 above"),
        pytest.param([3, 1, 2], [0, 5, 5], "single_excess", 2, id="cost at the winner above the least"),
        pytest.param([3, 1, 2], [0, 5, 5], "single_cost", 3, id="cost at the winner"),
        pytest.param([-3, 1, 2], [0, 5, 5], "single_cost", -3, id="a negative cost"),
        pytest.param([3, 1, 2], [5, 5, 0], "agrees", 1, id="within 1 px"),
        pytest.param([0, 1, 2], [5, 5, 0], "agrees", 0, id="not within 1 px"),
        pytest.param([9] * 4, [1, 2, 2.5, 9], "aggregated_flatness", 0.5, id="two of four within 1"),
        pytest.param([0, 1, 1.5, 9], [9] * 4, "single_flatness", 0.5, id="two of four costs within 1"),
        pytest.param([5, 5, 5, 5], [9] * 4, "single_flatness", 1, id="flat"),
        pytest.param([N, N, 0, N], [9] * 4, "single_flatness", 0.25, id="one cost that was judged"),
        pytest.param([0, 9, 1, 9, 2], [9] * 5, "single_minima", 2, id="two minima within 1"),
        pytest.param([5, 0, 0, 5, 0], [9] * 5, "single_minima", 2, id="a plateau is one"),
        pytest.param([1, 1, 9, 0, 9], [9] * 5, "single_minima", 2, id="a plateau before the least"),
        pytest.param([5, 5, 5, 5, 5], [9] * 5, "single_minima", 1, id="a flat curve is one plateau"),
        pytest.param([0, 1, 0, 1, 0], [9] * 5, "single_minima", 3, id="stripes"),
        pytest.param([5, 4, 3, 2, 1], [9] * 5, "single_minima", 1, id="falling to the end"),
    ],
)
def test_by_hand(costs: list[float], sums: list[float], feature: str, expected: float) -> None:
    assert last(costs, sums)[feature] == expected


def test_a_right_pixel_that_prefers_another_disparity_is_far() -> None:
    """Right pixel 1 is seen from pixel 1 at d = 0 for 4, and from pixel 3 at d = 2 for 1."""
    sums = [[5, 9, 9], [4, 9, 9], [0, 9, 9], [9, 9, 1]]
    assert features([[0, 0, 0]] * 4, sums)["left_right"] == [0, 2, 0, 0]


def test_cells_outside_the_image_do_not_count() -> None:
    made = features([[0, N, N], [0, 9, N], [9, 0, 9]], [[5, 0, 0], [5, 6, 0], [5, 0, 5]])
    assert made["aggregated_flatness"] == [1, 1, pytest.approx(1 / 3)]
    assert made["aggregated_margin"] == [40, 40, 40]
    assert made["single_minima"] == [1, 1, 1]


def test_a_pixel_without_a_winner_has_none() -> None:
    made = features([[N, N, N], [0, N, N], [0, 1, N]], [[0] * 3] * 3)
    assert all(np.isnan(values[0]) and np.isfinite(values[1:]).all() for values in made.values())


def test_one_disparity() -> None:
    assert features([[3]] * 2, [[3]] * 2)["aggregated_margin"] == [40, 40]


def test_the_largest_sums_do_not_overflow() -> None:
    made = features([[0, 9, 9]] * 6, [[900, 0, 900]] * 6)
    assert made["aggregated_margin"][-1] == 40
