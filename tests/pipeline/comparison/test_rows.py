import numpy as np
import pytest

from semidense.pipeline.comparison.rows import (
    CURVE_R,
    Judged,
    Row,
    auc_rows,
    curve_rows,
    density_rows,
    equal_density,
    raw_rows,
)

NAN = np.nan
TRUTH = np.array([[5, 5, 5, 5, NAN]], np.float32)
RAW = np.array([[5, 5, 9, 5, 5]], np.float32)
SURE = np.array([[0.9, 0.8, 0.2, 0.1, 0.9]], np.float32)


@pytest.fixture
def judged() -> Judged:
    """Four pixels with a truth, of which both views show the first three."""
    return Judged("hand", {"disparity": TRUTH, "nonocc": np.array([[True, True, True, False, False]])})


def at(rows: object, mask: str = "all") -> Row:
    (row,) = (row for row in rows if row["mask"] == mask and row["threshold_px"] == 1)  # type: ignore[attr-defined]
    return row


def test_what_a_dense_map_leaves_out_is_wrong(judged: Judged) -> None:
    holed = np.where(np.arange(5) == 3, NAN, RAW).astype(np.float32)
    row = at(raw_rows(judged, "any", holed))
    assert row == {
        "experiment": "raw",
        "scene": "hand",
        "method": "any",
        "mask": "all",
        "threshold_px": 1.0,
        "pixels": 4,
        "raw_bad": 50.0,
    }
    assert at(raw_rows(judged, "any", holed), "nonocc")["raw_bad"] == pytest.approx(100 / 3)


def test_a_semi_dense_map_answers_for_what_it_reports(judged: Judged) -> None:
    row = at(density_rows(judged, "any", np.where(np.arange(5) < 2, NAN, RAW).astype(np.float32)))
    assert (row["bad"], row["invalid"], row["avgerr"], row["rms"]) == (50, 50, 2, pytest.approx(8**0.5))


def test_a_figure_that_does_not_apply_is_absent(judged: Judged) -> None:
    empty = at(density_rows(judged, "any", np.full_like(RAW, NAN)))
    assert empty["invalid"] == 100 and not {"bad", "rms", "A50"} & set(empty)
    compared = at(equal_density(iter([empty]), judged, {"disparity": RAW, "confidence": SURE}))
    assert "bad_dual_cnn" not in compared


@pytest.mark.parametrize(("kept", "error"), [(2, 0), (3, 100 / 3), (4, 25)])
def test_our_error_is_taken_at_the_others_density(judged: Judged, kept: int, error: float) -> None:
    other = np.where(np.arange(5) < kept, RAW, NAN).astype(np.float32)
    rows = equal_density(density_rows(judged, "any", other), judged, {"disparity": RAW, "confidence": SURE})
    assert at(rows)["bad_dual_cnn"] == pytest.approx(error)


def test_the_curve_runs_over_the_threshold(judged: Judged) -> None:
    rows = [row for row in curve_rows(judged, {"disparity": RAW, "confidence": SURE}) if row["mask"] == "all"]
    at_one = {row["R"]: row for row in rows if row["threshold_px"] == 1}
    assert tuple(at_one) == CURVE_R
    assert (at_one[0.0]["bad"], at_one[0.0]["invalid"]) == (25, 0)
    assert (at_one[0.5]["bad"], at_one[0.5]["invalid"]) == (0, 50)
    assert "bad" not in at_one[0.99] and at_one[0.99]["invalid"] == 100


def test_a_better_confidence_has_a_smaller_area(judged: Judged) -> None:
    good = at(auc_rows(judged, "any", np.array([[4, 3, 1, 2, 0]], np.float32), RAW))
    poor = at(auc_rows(judged, "any", np.array([[1, 2, 4, 3, 0]], np.float32), RAW))
    assert good["auc"] == pytest.approx(1 / 16) and good["auc"] < poor["auc"]
    assert good["raw_bad"] == 25


def test_only_the_masks_and_thresholds_that_are_wanted(judged: Judged) -> None:
    wanted = Judged("hand", judged.truth, ["nonocc"], [2.0, 1.0])
    every = [row for row in auc_rows(judged, "any", SURE, RAW) if row["mask"] == "nonocc"]
    found = list(auc_rows(wanted, "any", SURE, RAW))
    assert [row["threshold_px"] for row in found] == [2.0, 1.0]
    assert all(row in every for row in found)
