import numpy as np
import pytest
from pydantic import ValidationError

from semidense.stages.evaluation.filtering import (
    SEMIDENSE,
    SemidenseParams,
    compute_semidense,
    keep_confident,
    threshold_for,
    threshold_for_error,
)
from semidense.stages.stage import StageError

N = np.nan


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


@pytest.mark.parametrize(
    ("density", "kept"),
    [
        pytest.param(0.25, 1, id="the most confident"),
        pytest.param(0.26, 2, id="at least as many as asked for"),
        pytest.param(0.75, 3, id="all that have a disparity"),
        pytest.param(1, 3, id="no more than have one"),
    ],
)
def test_a_density_keeps_the_most_confident(density: float, kept: int) -> None:
    disparity, confidence = np.float32([[5, 6, 7, N]]), np.float32([[0.2, 0.9, 0.5, 0.99]])
    inputs = {"disparity": {"disparity": disparity}, "confidence": {"confidence": confidence}}
    made = compute_semidense(SemidenseParams(density=density), inputs)
    assert np.isfinite(made["disparity"]).sum() == kept
    assert made["R"][0] == np.float32([0.9, 0.5, 0.2])[kept - 1]


@pytest.mark.parametrize(("density", "kept"), [(0.07, 7), (0.55, 55), (0.56, 56), (0.561, 57)])
def test_a_density_is_no_pixel_more_by_rounding(density: float, kept: int) -> None:
    confidence = np.linspace(0.1, 1, 100, dtype=np.float32).reshape(10, 10)
    R = threshold_for(density, np.ones((10, 10), np.float32), confidence)
    assert (confidence >= np.float32(R)).sum() == kept


def test_pixels_that_tie_with_the_last_are_kept_too() -> None:
    ones = np.ones((2, 2), np.float32)
    assert threshold_for(0.25, ones, ones) == 1
    inputs = {"disparity": {"disparity": ones}, "confidence": {"confidence": ones}}
    assert np.isfinite(compute_semidense(SemidenseParams(density=0.25), inputs)["disparity"]).all()


def test_a_density_of_a_map_without_disparities_keeps_nothing() -> None:
    assert threshold_for(0.5, np.full((2, 2), N), np.ones((2, 2))) == 1


@pytest.mark.parametrize(
    ("max_error", "kept"),
    [
        pytest.param(0.01, 0, id="none is so sure"),
        pytest.param(0.06, 1, id="the surest"),
        pytest.param(0.16, 2, id="0.15 to expect of two"),
        pytest.param(0.31, 3, id="all that have a disparity"),
    ],
)
@pytest.mark.parametrize("calibrated", [False, True])
def test_a_wanted_error_keeps_what_is_expected_to_keep_it(max_error: float, kept: int, calibrated: bool) -> None:
    """Right with 0.95, 0.75 and 0.4, whatever the confidence: it decides the order alone."""
    inputs = {
        "disparity": {"disparity": np.float32([[5, 6, 7, N]])},
        "confidence": {"confidence": np.float32([[0.2, 0.9, 0.5, 0.99]])},
        "calibrated_confidence": {"confidence": np.float32([[0.4, 0.95, 0.75, 0.98]])},
    }
    params = SemidenseParams(max_error=max_error, calibrated=calibrated)
    made = compute_semidense(params, {name: inputs[name] for name in params.inputs})
    assert np.isfinite(made["disparity"]).sum() == kept
    scale = [0.95, 0.75, 0.4] if calibrated else [0.9, 0.5, 0.2]
    assert made["R"][0] == np.float32([1, *scale])[kept]


def test_pixels_that_tie_are_kept_together_or_not_at_all() -> None:
    disparity, probability = np.zeros((1, 4)), np.array([[0.9, 0.6, 0.6, 0.6]])
    assert threshold_for_error(0.26, disparity, probability) == 0.9, "0.25 of two, but there are three such"
    assert threshold_for_error(0.35, disparity, probability) == 0.6
    assert threshold_for_error(0.35, disparity, np.full((1, 4), N)) == 1


def test_a_harder_map_keeps_less_for_the_same_error() -> None:
    easy = np.linspace(0.5, 1, 1000)[None]
    assert threshold_for_error(0.1, easy, easy) < threshold_for_error(0.1, easy, easy - 0.2)


@pytest.mark.parametrize("density", [0, 1.5, N])
def test_the_section_refuses_a_density(density: float) -> None:
    with pytest.raises(ValidationError, match="density"):
        SemidenseParams(density=density)


@pytest.mark.parametrize("wish", [{"density": 0.5}, {"max_error": 0.02}])
def test_a_threshold_that_is_replaced_is_in_no_key(wish: dict[str, float]) -> None:
    one, other = (SemidenseParams(R=R, **wish).model_dump(mode="json") for R in (0.2, 0.9))
    assert one == other and "R" not in one
    assert SemidenseParams(R=0.2).model_dump()["R"] == 0.2


def test_the_stage_makes_what_it_declares() -> None:
    made = SEMIDENSE.function()(SemidenseParams(R=0.5), maps())
    assert {name: str(array.dtype) for name, array in made.items()} == {
        output.name: output.dtype for output in SEMIDENSE.outputs
    }
    assert 0 < np.isnan(made["disparity"]).mean() < 1


NOTHING_SEEN = np.array([[0.9, 0.0, 0.95, 0.0]])


def test_a_density_never_keeps_where_nothing_was_seen() -> None:
    assert threshold_for(1.0, np.zeros((1, 4)), NOTHING_SEEN) == 0.9
    assert threshold_for(1.0, np.zeros((1, 4)), np.zeros((1, 4))) == 1


def test_a_wanted_error_never_keeps_where_nothing_was_seen() -> None:
    """Though the sure pixels would make up for them: 2.15 expected wrong of 4 are fewer than 60 %."""
    assert threshold_for_error(0.6, np.zeros((1, 4)), NOTHING_SEEN) == 0.9
