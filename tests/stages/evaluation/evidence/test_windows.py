import numpy as np
import pytest

from semidense.stages.evaluation.evidence.windows import window_mean


@pytest.mark.parametrize("side", [1, 9, 101])
def test_it_is_the_mean_of_what_is_known(side: int) -> None:
    rng = np.random.default_rng(0)
    block = rng.normal(size=(104, 107)).astype(np.float32)
    block[rng.random(block.shape) < 0.3] = np.nan
    cut = 50 - side // 2
    inner = block[cut : len(block) - cut, cut : block.shape[1] - cut]
    windows = np.lib.stride_tricks.sliding_window_view(inner, (side, side))
    with np.errstate(invalid="ignore"):
        expected = np.nansum(windows, axis=(2, 3), dtype=np.float64) / np.isfinite(windows).sum(axis=(2, 3))
    np.testing.assert_allclose(window_mean(block, side), expected, atol=1e-6)


def test_nothing_known_stays_unknown() -> None:
    assert np.isnan(window_mean(np.full((101, 101), np.nan, np.float32), 9)).all()
