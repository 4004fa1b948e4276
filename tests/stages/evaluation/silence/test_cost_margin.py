import numpy as np
import pytest

from semidense.stages.evaluation.silence.cost_margin import cost_margin
from semidense.stages.evaluation.silence.declaration import COST_MARGIN
from semidense.stages.stage import NoParams, StageError
from tests.stages.tiling import same, tiled, whole

NAN, INF = np.nan, np.inf


@pytest.mark.parametrize(
    ("costs", "expected"),
    [
        pytest.param([5, 1, 2, 4, 9], 3, id="what lies beside the winner is no rival"),
        pytest.param([1, 5, 5, 1, 5], 0, id="two equal minima"),
        pytest.param([2, 2, 2, 2], 0, id="flat"),
        pytest.param([NAN, 1, 3, NAN, NAN], 40, id="no rival is valid"),
        pytest.param([NAN, 4, NAN, 1, NAN], 3, id="the rival comes first"),
        pytest.param([-30, 0, 30], 40, id="at most 40"),
        pytest.param([7], 40, id="one disparity"),
        pytest.param([NAN, NAN], NAN, id="nothing is valid"),
        pytest.param([INF, INF, INF], 0, id="infinite costs are equal"),
        pytest.param([1, INF, INF], 40, id="an infinite rival"),
        pytest.param([NAN, INF, NAN], 40, id="an infinite winner without a rival"),
        pytest.param([INF, INF, NAN], 40, id="an infinite winner and what lies beside it"),
    ],
)
@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_by_hand(costs: list[float], expected: float, dtype: type) -> None:
    made = cost_margin(np.array([[costs]], dtype))
    assert made.dtype == np.float32
    assert np.array_equal(made, np.float32([[expected]]), equal_nan=True)


def test_tiles_equal_the_whole() -> None:
    costs = np.random.default_rng(0).normal(size=(9, 5, 7)).astype(np.float16)
    given, dims = {"costvolume": {"cost": costs}}, {"costvolume": {"cost": ("y", "x", "d")}}
    made = whole(COST_MARGIN, NoParams(), given, dims)
    assert same(tiled(COST_MARGIN, NoParams(), given, dims, 4), made)
    assert np.array_equal(made["margin"], cost_margin(costs))


def test_refuses_a_map() -> None:
    with pytest.raises(StageError, match="expected 3 dimensions"):
        cost_margin(np.zeros((3, 4), np.float32))
