import numpy as np
import pytest

from semidense.stages.baselines.sncc import correlation


@pytest.mark.parametrize(
    ("gain", "offset", "expected"),
    [
        pytest.param(1, 0, 1, id="the same"),
        pytest.param(0.5, 40, 1, id="another lighting"),
        pytest.param(-1, 0, -1, id="a negative"),
        pytest.param(0, 7, 0, id="flat: nothing to correlate"),
    ],
)
def test_correlation_ignores_gain_and_offset(gain: float, offset: float, expected: float) -> None:
    gray = np.random.default_rng(0).integers(-128, 128, (6, 8)).astype(np.float32)
    np.testing.assert_allclose(correlation(gray, (gain * gray + offset).astype(np.float32)), expected, atol=1e-3)


def test_the_centre_of_a_window_is_numpys_coefficient() -> None:
    left, right = np.random.default_rng(1).integers(-128, 128, (2, 3, 3)).astype(np.float32)
    expected = np.corrcoef(left.ravel(), right.ravel())[0, 1]
    assert correlation(left, right)[1, 1] == pytest.approx(expected, abs=1e-4)
