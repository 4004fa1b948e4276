import numpy as np
import pytest

from semidense.stages.evaluation.calibration.declaration import BINS, CALIBRATION, MAPS, CalibrationParams
from semidense.stages.evaluation.calibration.stage import compute_calibrated_confidence, compute_calibration
from semidense.stages.evaluation.calibration.table import EDGES, probability
from semidense.stages.stage import NoParams, StageError


def scenes(count: int, slope: float = 1.0) -> dict[str, list[dict[str, np.ndarray]]]:
    """Scenes whose disparities are right with a known probability of the confidence."""
    rng = np.random.default_rng(0)
    odds = rng.normal(1, 3, (count, 60, 70))
    wrong = rng.random(odds.shape) > probability(slope * odds)
    disparity = np.where(wrong, 20, 4).astype(np.float32)
    return {
        "confidence": [{"confidence": each} for each in probability(odds).astype(np.float32)],
        "disparity": [{"disparity": each} for each in disparity],
        "truth": [{"disparity": np.full((60, 70), 4.25, np.float32)}] * count,
    }


def test_the_stage_makes_what_it_declares() -> None:
    made = compute_calibration(CalibrationParams(fold_of_scene=(0, 1, 0)), scenes(3))
    assert {name: str(array.dtype) for name, array in made.items()} == {
        output.name: output.dtype for output in CALIBRATION.outputs
    }
    assert made["right"].shape == made["wrong"].shape == (3, BINS)
    assert (made["right"] + made["wrong"]).sum() == 3 * 60 * 70
    assert (made["score"].shape, made["log_odds"].shape) == ((len(MAPS),), EDGES.shape)


def test_a_sparse_truth_is_not_held_to_the_last_half_pixel() -> None:
    given, params = scenes(2), CalibrationParams(fold_of_scene=(0, 1))
    truth = np.full((60, 70), 5.2, np.float32)  # 1.2 px from the right disparities
    sparse = np.where(np.random.default_rng(0).random(truth.shape) < 0.3, truth, np.float32(np.nan))
    made = compute_calibration(params, {**given, "truth": [{"disparity": truth}, {"disparity": sparse}]})
    assert made["right"][0].sum() == 0 < made["right"][1].sum()
    assert made["tolerance"].tolist() == [1.0, 1.25]


def test_a_sound_confidence_is_left_nearly_as_it_is_and_an_oversure_one_is_corrected() -> None:
    sound = compute_calibration(CalibrationParams(fold_of_scene=(0, 1, 0, 1)), scenes(4))
    middle = np.abs(EDGES) < 2
    assert np.abs(probability(sound["log_odds"]) - probability(EDGES))[middle].max() < 0.06
    oversure = compute_calibration(CalibrationParams(fold_of_scene=(0, 1, 0, 1)), scenes(4, slope=0.4))
    assert oversure["score"].argmin() != MAPS.index("none")
    assert np.abs(probability(oversure["log_odds"]) - probability(0.4 * EDGES))[middle].max() < 0.06


def test_the_calibrated_confidence_is_how_often_pixels_are_right() -> None:
    given = scenes(4, slope=0.4)
    calibration = compute_calibration(CalibrationParams(fold_of_scene=(0, 1, 0, 1)), given)
    fresh = scenes(5, slope=0.4)
    right = fresh["disparity"][4]["disparity"] == 4
    inputs = {"confidence": fresh["confidence"][4], "calibration": calibration}
    made = compute_calibrated_confidence(NoParams(), inputs)["confidence"]
    assert made.dtype == np.float32
    sure = made > 0.8
    assert right[sure].mean() == pytest.approx(made[sure].mean(), abs=0.03)


@pytest.mark.parametrize(
    "folds",
    [
        pytest.param(None, id="no folds"),
        pytest.param((0, 1), id="too few"),
        pytest.param((0, 0, 0), id="one fold: nothing is held out"),
    ],
)
def test_folds_that_do_not_fit_are_refused(folds: tuple[int, ...] | None) -> None:
    with pytest.raises(StageError, match="folds were given for 3 scenes"):
        compute_calibration(CalibrationParams(fold_of_scene=folds), scenes(3))


def test_without_a_training_scene_it_says_so() -> None:
    with pytest.raises(StageError, match="no training scene"):
        compute_calibration(CalibrationParams(), {"confidence": [], "disparity": [], "truth": []})
