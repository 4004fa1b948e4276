import json

import numpy as np
import pytest

from semidense.stages.evaluation.filtering import keep_confident
from semidense.stages.metrics.confidence import auc, optimal_auc
from semidense.stages.metrics.errors import MASKS, THRESHOLDS, Errors, raw_bad
from semidense.stages.metrics.ranking import RANKED, RANKING
from semidense.stages.metrics.stage import FIGURES, METRICS, by_name, metric_rows
from semidense.stages.stage import NoParams, Stage, StageError
from tests.stages.tiling import same

N = np.nan
Given = dict[str, dict[str, np.ndarray]]
ROW = (
    *("scene", "method", "mask", "threshold_px", "R", "pixels"),
    *("raw_bad", "bad", "invalid", "avgerr", "rms", "auc", "auc_optimal"),
)


def products(R: float = 0.5) -> Given:
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


def ranked(given: Given) -> dict[str, np.ndarray]:
    return dict(RANKING.function()(NoParams(), {name: given[name] for name in RANKING.inputs}))


def made_of(given: Given) -> dict[str, np.ndarray]:
    whole = given | {"ranking": ranked(given)}
    return dict(METRICS.function()(NoParams(), {name: whole[name] for name in METRICS.inputs}))


def figures(given: Given) -> dict[str, np.ndarray]:
    return by_name(made_of(given)["figures"])


def test_every_figure_is_that_of_its_function() -> None:
    given = products()
    made = figures(given)
    truth, semidense, disparity = (given[name]["disparity"] for name in ("truth", "semidense", "disparity"))
    for m, mask in enumerate((given["truth"]["nonocc"], np.ones(truth.shape, bool))):
        counts = mask & ~np.isnan(truth)
        errors = Errors.of(semidense, truth, mask)
        same_at_each = {
            "pixels": counts.sum(),
            "invalid": errors.invalid(),
            "avgerr": errors.avgerr(),
            "rms": errors.rms(),
            **errors.quantiles(),
        }
        for t, threshold in enumerate((0.5, 1, 2, 4)):
            correct = (np.abs(disparity - truth) <= threshold)[counts]
            raw = raw_bad(disparity, truth, mask, threshold)
            expected = same_at_each | {
                "raw_bad": raw,
                "bad": errors.bad(threshold),
                "auc": auc(given["confidence"]["confidence"][counts], correct),
                "auc_optimal": optimal_auc(raw / 100),
            }
            assert {name: made[name][m, t] for name in expected} == pytest.approx(expected)


@pytest.mark.parametrize(("stage", "names"), [(METRICS, FIGURES), (RANKING, RANKED)], ids=["metrics", "ranking"])
def test_makes_what_it_declares(stage: Stage, names: tuple[str, ...]) -> None:
    made = (made_of if stage is METRICS else ranked)(products())
    assert list(made) == [output.name for output in stage.outputs]
    sizes = {"figure": len(names), "mask": len(MASKS), "threshold": len(THRESHOLDS)}
    for output in stage.outputs:
        assert made[output.name].dtype == output.dtype
        assert made[output.name].shape == tuple(sizes[dim] for dim in output.dims)
    assert stage.tile_rows is None
    named = by_name(made["figures"], names)
    assert {name: str(values.dtype) for name, values in named.items()} == {
        name: "int64" if name == "pixels" else "float64" for name in names
    }


def test_is_deterministic() -> None:
    assert same(made_of(products()), made_of(products()))


def test_ranking_does_not_depend_on_the_filter() -> None:
    """So a sweep over R finds it in the cache."""
    assert not {"semidense", "metrics"} & set(RANKING.inputs)
    assert not set(RANKING.params.model_fields)


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
    made = made_of(products())
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
    (row, *_) = metric_rows("Teddy", "sgm", None, made_of(given))
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
        made_of(given)
