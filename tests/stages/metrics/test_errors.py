import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from semidense.stages.metrics.errors import Errors, raw_bad
from semidense.stages.stage import StageError

N, I = np.nan, np.inf  # noqa: E741

#                     right  2 off  exactly 1 off  none  no truth  masked  inf
DISPARITY = np.float32([[5.0, 8.0, 4.0, N, 3.0, 9.0, I]])
TRUTH = np.float32([[5.0, 6.0, 3.0, 2.0, N, 1.0, 4.0]])
MASK = np.array([[True, True, True, True, True, False, True]])

pytestmark = pytest.mark.filterwarnings("error")


@pytest.mark.parametrize(
    ("threshold", "of_reported", "of_all"),
    [
        pytest.param(0.5, 200 / 3, 80, id="two of three, four of five"),
        pytest.param(1.0, 100 / 3, 60, id="an error of exactly 1 px is not above 1 px"),
        pytest.param(4.0, 0, 40, id="only the unreported are wrong"),
    ],
)
def test_bad_by_hand(threshold: float, of_reported: float, of_all: float) -> None:
    assert Errors.of(DISPARITY, TRUTH, MASK).bad(threshold) == pytest.approx(of_reported)
    assert raw_bad(DISPARITY, TRUTH, MASK, threshold) == pytest.approx(of_all)


def test_the_rest_by_hand() -> None:
    errors = Errors.of(DISPARITY, TRUTH, MASK)
    assert (errors.invalid(), errors.avgerr()) == (40, 1)
    assert errors.rms() == pytest.approx((5 / 3) ** 0.5)
    assert errors.quantiles() == {"A50": 1, "A90": 2, "A95": 2, "A99": 2}


@pytest.mark.parametrize(
    ("truth", "mask"),
    [
        pytest.param(TRUTH, np.zeros_like(MASK), id="empty mask"),
        pytest.param(np.full_like(TRUTH, N), MASK, id="no truth"),
        pytest.param(np.full_like(TRUTH, I), MASK, id="truth infinite: unknown as in a PFM file"),
    ],
)
def test_no_pixel_gives_nan(truth: np.ndarray, mask: np.ndarray) -> None:
    errors = Errors.of(DISPARITY, truth, mask)
    found = [errors.avgerr(), errors.rms(), errors.invalid(), errors.bad(1), errors.raw_bad(1)]
    assert np.isnan([*found, *errors.quantiles().values()]).all()


def test_quantiles_by_hand() -> None:
    errors = Errors.of(np.arange(1.0, 101.0), np.zeros(100), np.ones(100, bool))
    assert errors.quantiles() == {"A50": 50, "A90": 90, "A95": 95, "A99": 99}


def test_an_empty_map_cannot_win() -> None:
    nothing = Errors.of(np.full_like(TRUTH, N), TRUTH, MASK)
    assert nothing.raw_bad(1) == 100 == nothing.invalid()
    assert np.isnan([nothing.bad(1), nothing.avgerr(), nothing.rms(), *nothing.quantiles().values()]).all()


def test_float32_does_not_push_an_error_over_the_threshold() -> None:
    """The difference 8388609.5 would be rounded up to 8388610 in float32."""
    found, true = np.float32(2**23 + 2), np.float32(0.5)
    assert float(found - true) > float(found) - float(true)
    assert raw_bad(np.array([found]), np.array([true]), np.array([True]), float(found) - float(true)) == 0


maps = arrays(np.float32, 12, elements=st.one_of(st.just(np.float32(N)), st.floats(-60, 60, width=32)))


@given(maps, maps, arrays(np.bool_, 12), st.sampled_from([0.5, 1.0, 2.0]))
def test_the_measures_agree(disparity: np.ndarray, truth: np.ndarray, mask: np.ndarray, threshold: float) -> None:
    """Wrong = not reported + wrong among the reported."""
    errors = Errors.of(disparity, truth, mask)
    missing, wrong, dense = errors.invalid(), errors.bad(threshold), errors.raw_bad(threshold)
    if np.isnan(dense):
        assert np.isnan(missing) and np.isnan(wrong)
    else:
        assert dense == pytest.approx(missing + (0 if missing == 100 else wrong * (100 - missing) / 100))
    if not np.isnan(wrong):
        assert errors.avgerr() <= errors.rms() * (1 + 1e-12)
        values = list(errors.quantiles().values())
        assert values == sorted(values)


@pytest.mark.parametrize(
    ("disparity", "mask", "message"),
    [
        pytest.param(DISPARITY[:, 1:], MASK, r"disparity has shape \(1, 6\), the ground truth \(1, 7\)", id="map"),
        pytest.param(DISPARITY, MASK[:, 1:], r"mask has shape \(1, 6\), the ground truth \(1, 7\)", id="mask"),
        pytest.param(DISPARITY, MASK.astype(np.uint8), "mask has dtype uint8, expected bool", id="mask of 0 and 1"),
    ],
)
def test_refuses(disparity: np.ndarray, mask: np.ndarray, message: str) -> None:
    with pytest.raises(StageError, match=message):
        raw_bad(disparity, TRUTH, mask, 1)
