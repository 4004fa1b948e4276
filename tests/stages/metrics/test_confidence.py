from itertools import groupby, permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semidense.stages.metrics.confidence import auc, error_at_density, optimal_auc
from semidense.stages.stage import StageError

N = np.nan
pytestmark = pytest.mark.filterwarnings("error")


def brute_curves(confidence: list[float], correct: list[bool]) -> np.ndarray:
    """Wrong pixels among the first k, one row for each order that the confidence allows."""
    pairs = sorted(zip(confidence, correct, strict=True), key=lambda pair: -pair[0])
    groups = [[right for _, right in group] for _, group in groupby(pairs, key=lambda pair: pair[0])]
    orders = [sum(order, ()) for order in product(*(list(permutations(group)) for group in groups))]
    return np.cumsum(~np.array(orders), axis=1)


def perfect(n: int, wrong: int) -> tuple[np.ndarray, np.ndarray]:
    return np.linspace(1, 0, n), np.arange(n) < n - wrong


@pytest.mark.parametrize(
    ("confidence", "correct", "expected"),
    [
        pytest.param([0.9, 0.5], [True, False], (0 + 1 / 2) / 2, id="right first"),
        pytest.param([0.5, 0.9], [True, False], (1 + 1 / 2) / 2, id="wrong first"),
        pytest.param([0.5, 0.5], [True, False], (1 / 2 + 1 / 2) / 2, id="tied: the mean of the two"),
        pytest.param([0.9, 0.5, 0.5], [True, True, False], (0 + 1 / 4 + 1 / 3) / 3, id="tied after one"),
        pytest.param([0.9, N, N], [True, True, False], (0 + 1 / 4 + 1 / 3) / 3, id="NaN ranks last, tied"),
        pytest.param([N, -np.inf], [True, False], 1 / 2, id="NaN is as low as minus infinity"),
        pytest.param([np.inf, 3], [True, False], 1 / 4, id="any scale"),
        pytest.param([0.3], [False], 1, id="one wrong pixel"),
        pytest.param([0.3, 0.2], [True, True], 0, id="nothing wrong"),
        pytest.param([], [], N, id="no pixel"),
    ],
)
def test_auc_by_hand(confidence: list[float], correct: list[bool], expected: float) -> None:
    assert auc(np.array(confidence), np.array(correct, bool)) == pytest.approx(expected, abs=1e-15, nan_ok=True)


small = st.lists(st.tuples(st.sampled_from([0.0, 0.25, 0.5, 1.0]), st.booleans()), min_size=1, max_size=6)


@settings(max_examples=60, deadline=None)
@given(small)
def test_ties_are_the_mean_over_every_order(pixels: list[tuple[float, bool]]) -> None:
    confidence, correct = map(list, zip(*pixels, strict=True))
    curves = brute_curves(confidence, correct)
    shares = np.arange(1, len(pixels) + 1)
    assert auc(np.array(confidence), np.array(correct)) == pytest.approx(np.mean(curves / shares), abs=1e-13)
    for k in shares:
        at_density = error_at_density(np.array(confidence), np.array(correct), k / len(pixels))
        assert at_density == pytest.approx(100 * curves[:, k - 1].mean() / k, abs=1e-10)


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, np.uint8])
def test_auc_takes_any_dtype_and_shape(dtype: type) -> None:
    confidence = np.array([[4, 3], [2, 1]], dtype)
    correct = np.array([[True, False], [True, False]])
    assert auc(confidence, correct) == pytest.approx((0 + 1 / 2 + 1 / 3 + 2 / 4) / 4)


def test_auc_does_not_depend_on_the_order_of_pixels() -> None:
    rng = np.random.default_rng(0)
    confidence, correct = rng.integers(0, 9, 500) / 8, rng.random(500) > 0.3
    shuffled = rng.permutation(500)
    assert auc(confidence[shuffled], correct[shuffled]) == pytest.approx(auc(confidence, correct), abs=1e-14)


def test_auc_of_a_large_map_keeps_its_precision() -> None:
    rng = np.random.default_rng(0)
    correct = rng.random(200_000) > 0.2
    order = np.argsort(-(confidence := rng.random(200_000)))
    wrong = np.cumsum(~correct[order], dtype=np.int64)
    assert auc(confidence, correct) == pytest.approx(np.mean(wrong / np.arange(1, 200_001)), rel=1e-12)


@given(st.integers(1, 400), st.floats(0, 1))
def test_a_constant_confidence_gives_the_error_rate(n: int, share: float) -> None:
    wrong = round(n * share)
    assert auc(np.full(n, 0.7), np.arange(n) >= wrong) == pytest.approx(wrong / n, abs=1e-13)


@given(st.integers(1, 3000), st.floats(0, 1))
def test_a_perfect_ranking_is_optimal_up_to_e_over_n(n: int, share: float) -> None:
    wrong = round(n * share)
    excess = auc(*perfect(n, wrong)) - optimal_auc(wrong / n)
    assert -1e-12 <= excess <= wrong / n / n + 1e-12


@pytest.mark.parametrize("error_rate", [0.05, 0.2, 0.75])
def test_a_perfect_ranking_converges_as_e_over_2n(error_rate: float) -> None:
    """The sum over k / n is a right Riemann sum of a curve that rises from 0 to e: e / 2n above the integral."""
    for n in (1000, 10_000, 100_000):
        excess = auc(*perfect(n, round(n * error_rate))) - optimal_auc(error_rate)
        assert excess * 2 * n / error_rate == pytest.approx(1, abs=20 / n + 1e-4)


@settings(max_examples=50)
@given(small)
def test_nothing_beats_the_perfect_ranking(pixels: list[tuple[float, bool]]) -> None:
    confidence, correct = (np.array(values) for values in zip(*pixels, strict=True))
    assert auc(correct.astype(float), correct) <= auc(confidence, correct) + 1e-12


@pytest.mark.parametrize(
    ("error_rate", "area"),
    [
        pytest.param(0, 0, id="no error"),
        pytest.param(1, 1, id="all wrong: not 0 times minus infinity"),
        pytest.param(0.5, 0.5 + 0.5 * np.log(0.5), id="half"),
        pytest.param(1e-9, 5e-19, id="tiny: about e squared over 2"),
        pytest.param(N, N, id="unknown"),
    ],
)
def test_optimal_auc(error_rate: float, area: float) -> None:
    assert optimal_auc(error_rate) == pytest.approx(area, rel=1e-6, abs=1e-18, nan_ok=True)


@pytest.mark.parametrize(
    ("density", "percent"),
    [
        pytest.param(0.25, 0, id="the surest is right"),
        pytest.param(0.5, 50, id="one of two"),
        pytest.param(1.0, 50, id="two of four"),
        pytest.param(0.375, 100 / 3, id="between k = 1 and 2: half a wrong pixel of one and a half"),
        pytest.param(0.125, 0, id="less than a pixel"),
    ],
)
def test_error_at_density(density: float, percent: float) -> None:
    confidence, correct = np.array([0.9, 0.8, 0.7, 0.1]), np.array([True, False, True, False])
    assert error_at_density(confidence, correct, density) == pytest.approx(percent)


def test_error_at_density_of_nothing() -> None:
    assert np.isnan(error_at_density(np.zeros(0), np.zeros(0, bool), 0.5))


@pytest.mark.parametrize("correct", [np.array([1, 0]), np.array([True]), np.array([True, False, True])])
def test_auc_refuses(correct: np.ndarray) -> None:
    with pytest.raises(StageError, match="expected bool, one for each of 2 pixels"):
        auc(np.array([0.1, 0.2]), correct)
    with pytest.raises(StageError, match="expected bool"):
        error_at_density(np.array([0.1, 0.2]), correct, 0.5)


@pytest.mark.parametrize("value", [-0.1, 1.1])
def test_refuses_what_is_not_a_share(value: float) -> None:
    with pytest.raises(StageError, match="error rate is"):
        optimal_auc(value)
    with pytest.raises(StageError, match="density is"):
        error_at_density(np.zeros(2), np.array([True, False]), value)


def test_refuses_density_zero() -> None:
    with pytest.raises(StageError, match="density is 0"):
        error_at_density(np.zeros(2), np.array([True, False]), 0)
