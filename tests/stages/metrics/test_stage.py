import json

import numpy as np
import pytest

from semidense.stages.evaluation.filtering import keep_confident
from semidense.stages.metrics import (
    MASKS,
    METRICS,
    THRESHOLDS,
    auc,
    avgerr,
    bad,
    error_quantiles,
    invalid,
    metric_rows,
    optimal_auc,
    raw_bad,
    rms,
    stage,
)
from semidense.stages.metrics.stage import FIGURES, by_name
from semidense.stages.metrics.stage import compute_metrics as compute
from semidense.stages.stage import NoParams, StageError
from tests.stages.tiling import same

N = np.nan
ROW = (
    *("scene", "method", "mask", "threshold_px", "R", "pixels"),
    *("raw_bad", "bad", "invalid", "avgerr", "rms", "auc", "auc_optimal"),
)


def products(R: float = 0.5) -> dict[str, dict[str, np.ndarray]]:
    rng = np.random.default_rng(4)
    truth = rng.uniform(0, 60, (40, 30)).astype(np.float32)
    disparity = np.rint(truth + rng.normal(size=truth.shape) ** 3).astype(np.float32)
    confidence = rng.random(truth.shape).astype(np.float32)
    nonocc = rng.random(truth.shape) > 0.2
    truth[5:9], disparity[20], confidence[20] = N, N, N
    return {
        "semidense": {"disparity": keep_confident(disparity, confidence, R)},
        "disparity": {"disparity": disparity},
        "confidence": {"confidence": confidence},
        "truth": {"disparity": truth, "nonocc": nonocc},
    }


def figures(given: dict[str, dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    return by_name(METRICS.function()(NoParams(), given)["figures"])


def test_every_figure_is_that_of_its_function() -> None:
    given = products()
    made = figures(given)
    truth, semidense, disparity = (given[name]["disparity"] for name in ("truth", "semidense", "disparity"))
    for m, mask in enumerate((given["truth"]["nonocc"], np.ones(truth.shape, bool))):
        counts = mask & ~np.isnan(truth)
        same_at_each = {
            "pixels": counts.sum(),
            "invalid": invalid(semidense, truth, mask),
            "avgerr": avgerr(semidense, truth, mask),
            "rms": rms(semidense, truth, mask),
            **error_quantiles(semidense, truth, mask),
        }
        for t, threshold in enumerate((0.5, 1, 2, 4)):
            correct = (np.abs(disparity - truth) <= threshold)[counts]
            raw = raw_bad(disparity, truth, mask, threshold)
            expected = same_at_each | {
                "raw_bad": raw,
                "bad": bad(semidense, truth, mask, threshold),
                "auc": auc(given["confidence"]["confidence"][counts], correct),
                "auc_optimal": optimal_auc(raw / 100),
            }
            assert {name: made[name][m, t] for name in expected} == pytest.approx(expected)


def test_makes_what_it_declares() -> None:
    made = METRICS.function()(NoParams(), products())
    assert list(made) == [output.name for output in METRICS.outputs]
    sizes = {"figure": len(FIGURES), "mask": len(MASKS), "threshold": len(THRESHOLDS)}
    for output in METRICS.outputs:
        assert made[output.name].dtype == output.dtype
        assert made[output.name].shape == tuple(sizes[dim] for dim in output.dims)
    assert METRICS.tile_rows is None
    assert {name: values.dtype for name, values in by_name(made["figures"]).items()} == {
        name: dtype for name, (dtype, _, _) in FIGURES.items()
    }


def test_is_deterministic() -> None:
    assert same(METRICS.function()(NoParams(), products()), METRICS.function()(NoParams(), products()))


def test_raw_error_and_area_do_not_depend_on_the_filter() -> None:
    few, many = (figures(products(R)) for R in (0.9, 0.1))
    for name in ("raw_bad", "auc", "auc_optimal", "pixels"):
        assert np.array_equal(few[name], many[name])
    assert (few["invalid"] > many["invalid"]).all()


@pytest.mark.filterwarnings("error")
def test_without_ground_truth_all_is_nan_and_no_pixel_counts() -> None:
    given = products()
    given["truth"]["disparity"] = np.full((40, 30), N, np.float32)
    made = figures(given)
    assert not made.pop("pixels").any()
    assert all(np.isnan(values).all() for values in made.values())


@pytest.mark.filterwarnings("error")
def test_when_nothing_is_reported() -> None:
    given = products()
    given["semidense"]["disparity"] = given["disparity"]["disparity"] = np.full((40, 30), N, np.float32)
    made = figures(given)
    assert (made["raw_bad"] == 100).all() and (made["invalid"] == 100).all() and np.isnan(made["bad"]).all()
    assert made["auc"] == pytest.approx(1) and (made["auc_optimal"] == 1).all()


def test_rows_are_those_promised() -> None:
    made = METRICS.function()(NoParams(), products())
    rows = metric_rows("Teddy", "ours", 0.5, made)
    assert [(row["mask"], row["threshold_px"]) for row in rows] == [(m, t) for m in MASKS for t in (0.5, 1, 2, 4)]
    assert all(tuple(row) == ROW for row in rows)
    named = by_name(made["figures"])
    assert rows[5]["raw_bad"] == named["raw_bad"][1, 1] and rows[5]["pixels"] == named["pixels"][1, 1]
    assert (rows[0]["scene"], rows[0]["method"], rows[0]["R"]) == ("Teddy", "ours", 0.5)
    assert json.loads(json.dumps(rows, allow_nan=False)) == rows


def test_what_does_not_apply_is_absent() -> None:
    given = products()
    given["semidense"]["disparity"] = np.full((40, 30), N, np.float32)
    (row, *_) = metric_rows("Teddy", "sgm", None, METRICS.function()(NoParams(), given))
    assert set(ROW) - set(row) == {"R", "bad", "avgerr", "rms"}


@pytest.mark.parametrize(
    ("product", "array"),
    [("semidense", "disparity"), ("disparity", "disparity"), ("confidence", "confidence"), ("truth", "nonocc")],
)
def test_refuses_another_shape(product: str, array: str) -> None:
    given = products()
    given[product][array] = given[product][array][1:]
    name = array if array == "nonocc" else product
    with pytest.raises(StageError, match=rf"{name} has shape \(39, 30\), the ground truth \(40, 30\)"):
        METRICS.function()(NoParams(), given)


def test_a_sweep_ranks_the_pixels_once(monkeypatch: pytest.MonkeyPatch) -> None:
    ranked = []
    plain = stage.Ranking.of
    monkeypatch.setattr(stage, "_known", {})
    monkeypatch.setattr(stage.Ranking, "of", lambda confidence: ranked.append(confidence) or plain(confidence))
    made = [compute(NoParams(), products(R)) for R in (0.2, 0.5, 0.8)]
    assert len(ranked) == len(MASKS)
    assert not same(made[0], made[1])
    monkeypatch.setattr(stage, "_known", {})
    assert same(made[2], compute(NoParams(), products(0.8)))


@pytest.mark.parametrize(
    ("product", "name"),
    [("disparity", "disparity"), ("confidence", "confidence"), ("truth", "disparity"), ("truth", "nonocc")],
)
def test_what_was_ranked_for_other_arrays_is_not_taken(
    product: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, other = products(), products()
    other[product][name] = np.flipud(other[product][name]).copy()
    compute(NoParams(), before)
    after = compute(NoParams(), other)
    monkeypatch.setattr(stage, "_known", {})
    assert same(after, compute(NoParams(), other))
    assert not np.array_equal(figures(other)["auc"], figures(before)["auc"])
