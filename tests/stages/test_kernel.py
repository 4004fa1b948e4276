import numpy as np

from stages.kernel import kernel


@kernel
def _total(values: np.ndarray) -> float:
    total = 0.0
    for value in values:
        total += value
    return total


def test_compiles_a_loop() -> None:
    assert _total(np.array([1.0, 2.0, 4.0])) == 7.0


def test_keeps_ieee_rules() -> None:
    assert np.isnan(_total(np.array([1.0, np.nan])))
    assert _total(np.array([1e16, 1.0, -1e16])) == 0.0, "sums are not reordered"
