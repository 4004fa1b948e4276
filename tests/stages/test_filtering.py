import numpy as np
import pytest
from pydantic import ValidationError

from stages.filtering import SEMIDENSE, SemidenseParams, keep_confident
from stages.stage import StageError
from tests.stages.tiling import same, tiled, whole

N = np.nan
DIMS = {"disparity": {"disparity": ("y", "x")}, "confidence": {"confidence": ("y", "x")}}


def maps() -> dict[str, dict[str, np.ndarray]]:
    rng = np.random.default_rng(0)
    disparity, confidence = rng.uniform(0, 60, (20, 7)).astype(np.float32), rng.random((20, 7)).astype(np.float32)
    disparity[4, :3] = confidence[4, 2:5] = N
    return {"disparity": {"disparity": disparity}, "confidence": {"confidence": confidence}}


@pytest.mark.parametrize(
    ("disparity", "confidence", "R", "expected"),
    [
        pytest.param(7, 0.95, 0.9, 7, id="above"),
        pytest.param(7, 0.9, 0.9, 7, id="at the threshold, though float32 0.9 < 0.9"),
        pytest.param(7, 0.89, 0.9, N, id="below"),
        pytest.param(7, N, 0.0, N, id="no confidence is never kept"),
        pytest.param(N, 1.0, 0.9, N, id="no disparity stays none"),
        pytest.param(7, 0.0, 0.0, 7, id="R = 0 keeps all"),
        pytest.param(7, 1.0, 1.0, 7, id="R = 1 keeps the certain"),
        pytest.param(-3, 1.0, 0.5, -3, id="negative disparity"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_by_hand(disparity: float, confidence: float, R: float, expected: float) -> None:
    made = keep_confident(np.float32([[disparity]]), np.float32([[confidence]]), R)
    assert made.dtype == np.float32
    assert np.array_equal(made, np.float32([[expected]]), equal_nan=True)


def test_more_confidence_keeps_a_subset() -> None:
    given = maps()
    kept = [
        ~np.isnan(keep_confident(given["disparity"]["disparity"], given["confidence"]["confidence"], R))
        for R in (0.1, 0.5, 0.9)
    ]
    assert (kept[0] >= kept[1]).all() and (kept[1] >= kept[2]).all() and kept[0].sum() > kept[2].sum() > 0


@pytest.mark.parametrize("R", [-0.1, 1.1, N, 90])
def test_refuses_a_threshold(R: float) -> None:
    with pytest.raises(StageError, match=r"R is .+, expected a number in \[0, 1\]"):
        keep_confident(np.zeros((1, 1)), np.zeros((1, 1)), R)


def test_refuses_maps_of_different_shapes() -> None:
    with pytest.raises(StageError, match=r"disparity has shape \(1, 2\), confidence \(2, 1\)"):
        keep_confident(np.zeros((1, 2)), np.zeros((2, 1)), 0.5)


@pytest.mark.parametrize("R", [-0.1, 1.5, N])
def test_the_section_refuses_a_threshold(R: float) -> None:
    with pytest.raises(ValidationError, match="R\n"):
        SemidenseParams(R=R)


def test_the_papers_threshold_is_the_default() -> None:
    assert SemidenseParams().R == 0.9


@pytest.mark.parametrize("rows", [1, 6, 19])
def test_tiles_equal_the_whole(rows: int) -> None:
    params = SemidenseParams(R=0.5)
    assert same(tiled(SEMIDENSE, params, maps(), DIMS, rows), whole(SEMIDENSE, params, maps(), DIMS))


def test_the_stage_makes_what_it_declares() -> None:
    made = SEMIDENSE.function()(SemidenseParams(R=0.5), maps())
    assert list(made) == [output.name for output in SEMIDENSE.outputs]
    assert made["disparity"].dtype == SEMIDENSE.outputs[0].dtype
    assert 0 < np.isnan(made["disparity"]).mean() < 1
