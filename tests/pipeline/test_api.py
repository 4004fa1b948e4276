import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semidense.cache import Store
from semidense.pipeline import api
from semidense.pipeline.api import Task, open_store, sweep_request
from semidense.pipeline.cli.options import chosen_preset
from semidense.pipeline.plan.config import Settings
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.results.estimate import estimate
from semidense.pipeline.results.opening import open_product, recorded
from semidense.pipeline.results.result import Result
from semidense.pipeline.variants import parse_thresholds
from semidense.stages.stage import StageError
from tests.tiny import SPEC, TEST_ONLY

MakePair = Callable[[Path], Path]


@pytest.mark.parametrize(
    ("text", "values"),
    [
        pytest.param("0.05:0.95:0.05", [round(0.05 * n, 2) for n in range(1, 20)], id="the last is included"),
        pytest.param("0.1:0.35:0.1", [0.1, 0.2, 0.3], id="the last is not hit"),
        pytest.param("0:1:0.5", [0, 0.5, 1], id="both ends"),
        pytest.param("0.5:0.5:1", [0.5], id="first is last"),
        pytest.param("0.9", [0.9], id="one"),
        pytest.param("0.9,0.1", [0.9, 0.1], id="as they come"),
        pytest.param([0.2, 0.4], [0.2, 0.4], id="a sequence"),
        pytest.param(np.array([0.25, 0.5]), [0.25, 0.5], id="an array"),
        pytest.param((share / 4 for share in (1, 2)), [0.25, 0.5], id="a generator"),
    ],
)
def test_thresholds_are_read(text: str, values: list[float]) -> None:
    assert parse_thresholds(text) == values


def test_what_a_sweep_cannot_sweep_is_refused() -> None:
    task = Task(SPEC, train=True)
    with pytest.raises(UsageError, match=r"training\.dataset cannot be swept"):
        sweep_request(task, 0.5, {"training.dataset": [SPEC, f"{SPEC},seed=2"]})
    with pytest.raises(UsageError, match=r"semidense\.R is swept by R"):
        sweep_request(task, 0.5, {"semidense.R": [0.2, 0.3]})
    with pytest.raises(UsageError, match="replace R, which then decides nothing; leave R out"):
        sweep_request(task.and_settings(["semidense.density=0.5"]), "0.1,0.5", ())
    with pytest.raises(UsageError, match="replace R, which then decides nothing; leave R out"):
        sweep_request(task, 0.9, {"semidense.density": [0.5, 0.6]})


def test_thresholds_are_tried_only_where_they_decide() -> None:
    task = Task(SPEC, train=True)
    densities = sweep_request(task, None, {"semidense.density": [0.5, 0.6]}).configs
    assert [*densities] == ["semidense.density=0.5", "semidense.density=0.6"]
    assert [*sweep_request(task.and_settings(["semidense.max_error=0.02"]), None, ()).configs] == [""]
    assert len(sweep_request(task, None, ()).configs) == 19


def test_a_sweep_without_a_ground_truth_is_refused(make_pair: MakePair, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="pair: no scene asked for has a ground truth to judge maps by"):
        sweep_request(Task(make_pair(tmp_path / "pair")), 0.5, ())


def test_a_swept_setting_that_changes_nothing_is_noted(tmp_path: Path) -> None:
    task = Task(TEST_ONLY, cache=tmp_path)
    over = {"refined.tolerance": [1, 2], "disparity.subpixel": [True, False]}
    notes = api.planned(task, sweep_request(task, "0.1,0.5", over)).notes
    assert [note for note in notes if "changes nothing" in note] == [
        "refined.tolerance changes nothing here: the metrics are the same for each of its values"
    ]


def test_a_setting_that_is_swept_twice_is_refused() -> None:
    twice = ["confidence.window=5,25", "disparity.subpixel=false", "confidence.window=41"]
    with pytest.raises(UsageError, match=r"window is given twice.*at once: confidence\.window=5,25,41$"):
        sweep_request(Task(SPEC, train=True), 0.5, twice)


def test_of_a_setting_that_a_run_is_given_twice_the_later_value_wins() -> None:
    config = Task(SPEC, settings=["confidence.window=5", "confidence.window=41"]).configuration()
    assert config.to_dict()["confidence"]["window"] == 41


def test_a_product_of_training_scenes_needs_some(tmp_path: Path) -> None:
    for product in ("matching_samples", "o1", "ccnn"):
        with pytest.raises(UsageError, match="is made from training scenes, and there are none here: add --train"):
            api.status(SPEC, product, cache=tmp_path)


def test_what_a_run_does_not_make_cannot_be_forced(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="metrics cannot be forced: a run up to channels does not make it"):
        api.status(SPEC, "channels", forced=["metrics"], cache=tmp_path)


@pytest.mark.parametrize("setting", ["weights.matching_net", "config"])
def test_a_pipe_keeps_no_plan_waiting(tmp_path: Path, setting: str) -> None:
    pipe = tmp_path / ("c.json" if setting == "config" else "w.safetensors")
    os.mkfifo(pipe)
    how = {"config": pipe} if setting == "config" else {"settings": [f"{setting}={pipe}"]}
    with pytest.raises((UsageError, StageError), match=r"cannot be read .a pipe or a device"):
        api.status(TEST_ONLY, cache=tmp_path / "cache", **how)
    assert chosen_preset(None, tmp_path / "c.json") == "paper"


def test_infinity_is_no_setting() -> None:
    with pytest.raises(UsageError, match=r"refined\.tolerance = inf"):
        Task(SPEC, settings=["refined.tolerance=Infinity"]).configuration()


def test_a_value_that_stands_alone_is_swept_as_one() -> None:
    assert parse_thresholds(np.float32(0.5)) == parse_thresholds(0.5) == [0.5]  # type: ignore[arg-type]
    assert parse_thresholds(np.int64(1)) == [1]  # type: ignore[arg-type]
    one, other = (
        sweep_request(Task(SPEC), 0.5, {"costvolume.mode": value, "channels.rank_window": 15})
        for value in ("fast", ["fast"])
    )
    assert [*one.configs] == [*other.configs]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a",
        "0.1:0.2",
        "0.1:0.2:0.3:0.4",
        "0.5:0.1:0.1",
        "0:1:0",
        "0:1:-0.1",
        "0:1:1e-9",
        "nan",
        "0.1,",
        "1.5",
        "-0.1",
        "0:2:0.5",
        "0:inf:0.1",
        "nan:1:0.1",
        [],
        None,
        True,
        [None],
        [[0.1, 0.2], [0.3, 0.4]],
        np.full((2, 2), 0.5),
    ],
)
def test_other_thresholds_are_refused_in_one_line(text: object) -> None:
    with pytest.raises(UsageError, match=r"^R = ") as caught:
        parse_thresholds(text)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_the_cache_is_where_one_says_then_where_the_environment_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PIPELINE_CACHE", str(tmp_path / "environment"))
    assert open_store(tmp_path / "said").root == tmp_path / "said"
    assert open_store().root == tmp_path / "environment"
    monkeypatch.delenv("PIPELINE_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    assert open_store().root.name == "semidense-stereo"
    assert list(tmp_path.iterdir()) == [], "asking makes nothing"


def test_a_home_is_expanded(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert open_store("~/c").root == tmp_path / "c"


def test_an_opened_cache_is_taken_as_it_is(tmp_path: Path) -> None:
    store = Store(tmp_path, "size")
    assert open_store(store) is store
    assert api.run(TEST_ONLY, "images", cache=store).store is store


@pytest.mark.parametrize("cache", [3, b"cache", ["cache"], Task()], ids=repr)
def test_what_names_no_cache_makes_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cache: Any) -> None:  # noqa: ANN401
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match=r"^cache = .*: give a folder, a URL, or"):
        api.run(TEST_ONLY, "images", cache=cache)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        pytest.param({"settings": 3}, "settings = 3: give a text", id="a number as settings"),
        pytest.param({"settings": [("semidense.R", 0.8)]}, r"settings = \[\(.*: give a text", id="pairs as settings"),
        pytest.param({"settings": b"semidense.R=1"}, "settings = b'.*: give a text", id="bytes as settings"),
        pytest.param({"scenes": 3}, "scenes = 3: give a text", id="a number as scenes"),
        pytest.param({"scenes": [3]}, r"scenes = \[3\]: give a text", id="numbers as scenes"),
        pytest.param({"config": {"semidense": {}}}, "config = .*: give a TOML file", id="a mapping as a file"),
        pytest.param({"preset": None}, "no preset None; there are paper", id="no preset"),
        pytest.param({"preset": ["paper"]}, "no preset .'paper'.", id="several presets"),
        pytest.param({"upto": None}, "no product None", id="no product"),
        pytest.param({"upto": ["disparity"]}, "no product .'disparity'.", id="several products"),
        pytest.param({"forced": 3}, "forced = 3: give a text", id="a number as a product"),
        pytest.param({"workers": 0}, "workers = 0: give a whole number from 1", id="no worker"),
    ],
)
def test_arguments_of_another_kind_are_refused_in_one_line(
    tmp_path: Path, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        api.run(TEST_ONLY, **{"upto": "images", "cache": tmp_path / "cache"} | options)
    assert not (tmp_path / "cache").exists()


def test_none_means_that_nothing_was_given(tmp_path: Path) -> None:
    plan = api.status(TEST_ONLY, "images", scenes=None, settings=None, config=None, forced=None, cache=tmp_path)
    assert [planned.step.product for planned in plan.steps] == ["images"]


def test_one_product_may_be_forced_by_a_text(tmp_path: Path) -> None:
    assert api.status(TEST_ONLY, "images", forced="images", cache=tmp_path).forced == {"images"}
    made = api.run(TEST_ONLY, "images", forced=iter(["images"]), cache=tmp_path)
    assert made.plan.forced == {"images"}


def test_a_result_is_found_by_product_and_scene(trained: Result) -> None:
    assert trained.find("metrics").step.scene == "test-0"
    assert trained.find("costvolume", "train-1").step.scene == "train-1"
    assert trained.find("matching_net").step.product == "matching_net"


def test_the_figures_of_opened_metrics_have_names_and_units(trained: Result) -> None:
    opened = trained.open("metrics")
    row = next(row for row in trained.metrics if (row["mask"], row["threshold_px"]) == ("all", 1.0))
    assert "figures" not in opened
    for name in ("raw_bad", "invalid", "auc", "pixels"):
        assert opened[name].sel(mask="all", threshold=1.0).item() == row[name]
    assert opened["raw_bad"].attrs["units"] == "%" and opened["pixels"].dtype == "int64"


@pytest.mark.parametrize(
    ("product", "scene", "message"),
    [
        pytest.param("costvolume", None, r"3 results fit \(test-0, train-0, train-1\); name a scene", id="several"),
        pytest.param("costvolume", "test", r"was not made of test; did you mean test-0", id="no such scene"),
        pytest.param("confidences", None, r"^no confidences was made; did you mean confidence", id="no such product"),
    ],
)
def test_what_is_not_one_result_is_refused(trained: Result, product: str, scene: str | None, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        trained.find(product, scene)


def test_an_opened_volume_has_names_coordinates_units_and_provenance(trained: Result) -> None:
    costs = trained.open("costvolume", "test-0")
    assert costs["cost"].dims == ("y", "x", "d")
    assert dict(costs.sizes) == {"y": 64, "x": 80, "d": 9}
    assert costs["d"].values.tolist() == list(range(9))
    assert {name: costs[name].attrs["units"] for name in ("y", "x", "d", "cost", "probability")} == {
        "y": "px", "x": "px", "d": "px", "cost": "1", "probability": "1",
    }  # fmt: skip
    assert costs["cost"].sel(y=10, x=20, d=3).size == 1
    assert costs.attrs["stage"] == "costvolume"
    assert recorded(costs, "params")["d_max"] == 8
    assert recorded(costs, "inputs")["matching_net"] == trained.find("matching_net").digest
    assert "semidense.stages.matching.cost_volume" in recorded(costs, "code")
    assert recorded(costs, "extras")["configuration"]["matching_net"]["steps"] == 2


def test_a_volume_is_read_when_it_is_needed(trained: Result) -> None:
    costs = trained.open("costvolume", "test-0")
    assert all(array.chunks is not None for array in costs.data_vars.values())


def test_a_probability_is_that_of_a_mismatch(trained: Result) -> None:
    costs = trained.open("costvolume", "test-0").isel(y=30)
    cost = costs["cost"].values.astype(np.float32)
    assert np.allclose(costs["probability"].values, 1 / (1 + np.exp(-cost)), equal_nan=True)
    assert np.isnan(cost[0, 1:]).all(), "no right pixel"
    assert np.isfinite(cost[8:]).all()


def test_a_disparity_comes_with_coordinates(trained: Result) -> None:
    disparity = open_product(trained.store, trained.find("disparity", "test-0").key)["disparity"]
    assert disparity.dims == ("y", "x")
    assert disparity["x"].values[-1] == 79


def test_metrics_have_the_promised_keys(trained: Result) -> None:
    promised = {"scene", "method", "mask", "threshold_px", "R", "pixels", "raw_bad", "bad", "invalid", "avgerr", "rms"}
    promised |= {"auc", "auc_optimal"}
    assert [(row["mask"], row["threshold_px"]) for row in trained.metrics] == [
        (mask, threshold) for mask in ("nonocc", "all") for threshold in (0.5, 1, 2, 4)
    ]
    assert all(set(row) <= promised for row in trained.metrics)
    assert {row["R"] for row in trained.metrics} == {0.9}


def test_a_scene_s_mask_is_told(trained: Result) -> None:
    assert trained.mask_kinds() == dict.fromkeys(("test-0", "train-0", "train-1"), "exact")


def test_status_takes_a_dataset_s_name(trained_task: Task, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIPELINE_CACHE", str(trained_task.cache))
    plan = api.status("synthetic:train=1,test=0,height=64,width=80,disparities=8", "channels")
    assert [(planned.step.product, planned.state) for planned in plan.steps] == [("images", "hit"), ("channels", "hit")]


def test_a_short_name_of_a_scene_is_enough(trained_task: Task) -> None:
    plan = api.status(replace(trained_task, scenes=("test-0",), train=False, dataset=trained_task.dataset), "channels")
    assert {planned.step.scene for planned in plan.steps} == {"test-0"}


def test_explain_gives_the_step_of_the_one_scene(trained_task: Task) -> None:
    planned = api.explain(trained_task, "confidence")
    assert (planned.step.product, planned.step.scene, planned.state) == ("confidence", "test-0", "hit")
    assert api.explain(trained_task, "matching_net").state == "hit"


def test_explain_wants_one_scene() -> None:
    task = Task("synthetic")
    with pytest.raises(UsageError, match=r"channels of synthetic: 5 scenes fit \(train-0, .*test-1\); name one"):
        api.explain(task, "channels")
    assert api.explain(task, "channels", "test-1").step.scene == "test-1"
    with pytest.raises(UsageError, match="channels of test-7: 0 scenes fit"):
        api.explain(task, "channels", "test-7")


def test_explain_does_not_pass_another_product_off(weights: Path, make_pair: MakePair, tmp_path: Path) -> None:
    task = Task(f"middlebury:{make_pair(tmp_path / 'pair')}", cache=tmp_path / "cache")
    with pytest.raises(UsageError, match="pair has no ground truth"):
        api.explain(task, "metrics")


def test_a_sweep_names_each_combination(own_task: Task) -> None:
    small = replace(own_task, settings=())
    variants = api.sweep(replace(small, config=_config(own_task)), "0.1,0.9", ["disparity.subpixel=false"]).plan.targets
    assert [variant for _, variant in variants] == [
        "semidense.R=0.1, disparity.subpixel=false",
        "semidense.R=0.9, disparity.subpixel=false",
    ]


def _config(task: Task) -> Path:
    """Return the task's settings as a file beside its cache."""
    tables: dict[str, list[str]] = {}
    for setting in task.settings:
        section, _, rest = setting.partition(".")
        tables.setdefault(section, []).append(rest)
    file = Path(str(task.cache)).parent / "tiny.toml"
    file.write_text("\n".join(line for name, lines in tables.items() for line in (f"[{name}]", *lines)))
    return file


@pytest.mark.parametrize(
    "settings",
    [
        pytest.param({"semidense.R": 0.25, "channels.use": ("gray", "rank")}, id="a mapping"),
        pytest.param(["semidense.R=0.25", "channels.use=gray,rank"], id="texts"),
        pytest.param({"semidense.R": np.float64(0.25), "channels.use": ["gray", "rank"]}, id="NumPy's number"),
    ],
)
def test_settings_are_taken_as_people_type_them(settings: Settings) -> None:
    found = Task(settings=settings).configuration()
    assert (found.semidense.R, found.channels.use) == (0.25, ("gray", "rank"))


def test_one_text_is_one_setting_and_one_name_is_one_scene() -> None:
    task = Task(settings="semidense.R=0.5", scenes="Teddy")
    assert (task.settings, task.scenes) == (("semidense.R=0.5",), ("Teddy",))


def test_a_setting_that_no_configuration_can_hold_is_refused() -> None:
    with pytest.raises(UsageError, match=r"^setting semidense\.R = <object"):
        Task(settings={"semidense.R": object()})


def test_options_refine_a_task(tmp_path: Path) -> None:
    task = Task.of(Task("synthetic", settings="semidense.R=0.5"), cache=tmp_path, train=True)
    assert (task.dataset, task.settings, task.cache, task.train) == ("synthetic", ("semidense.R=0.5",), tmp_path, True)


def test_a_folder_is_a_dataset(make_pair: MakePair, tmp_path: Path) -> None:
    pair = make_pair(tmp_path / "pair")
    assert Task(pair).open().scenes == Task(f"middlebury:{pair}").open().scenes


def test_a_sweep_takes_a_number_and_a_mapping(own_task: Task) -> None:
    small = replace(own_task, scenes=("test-0",))
    swept = api.sweep(small, R=0.1234567, over={"disparity.subpixel": [True, False]})
    assert {row["R"] for row in swept.metrics} == {0.1234567}
    assert len({row["variant"] for row in swept.metrics}) == 2


def test_results_and_plans_are_one_line(trained: Result, trained_task: Task) -> None:
    plan = api.status(trained_task)
    texts = [repr(each) for each in (trained, plan, plan.steps[0], plan.steps[0].step, trained.find("metrics"))]
    assert max(map(len, texts)) < 100
    assert texts[0] == "<Result of test-0: 27 products made, 0 reused>"
    assert texts[1:] == [
        "<Plan: 27 products, 0 to make>", "<images of test-0: hit>", "<Step images of test-0>",
        "<metrics of test-0: made>",
    ]  # fmt: skip


def test_a_notebook_gets_a_table(trained: Result) -> None:
    page = trained._repr_html_()
    assert page.count("<tr>") == 1 + sum(row["mask"] == "nonocc" for row in trained.metrics)
    assert "<th>raw_bad</th>" in page and len(page) < 5000


def test_every_verb_is_offered_under_its_name() -> None:
    from semidense import pipeline

    assert set(pipeline.__all__) <= set(dir(pipeline))
    assert all(getattr(pipeline, name).__name__ == name for name in pipeline.__all__)


def test_a_stage_that_takes_the_place_of_another_is_told_by_its_own_settings(tmp_path: Path) -> None:
    task = Task(TEST_ONLY, cache=tmp_path, settings=["use.disparity=aggregated", "costvolume.mode=fast"])
    api.run(task.and_settings(["use.disparity=disparity"]), "disparity")
    expected = estimate(api.status(task, "disparity"), open_store(tmp_path))
    assert expected.unknown == ("disparity",), "the time of the winner of single costs says nothing of the sums"
    api.run(task, "disparity")
    changed = api.status(task.and_settings(["aggregated.passes=2"]), "disparity").steps[-1]
    assert (changed.step.product, changed.causes) == ("disparity", ("aggregated.passes: 1 -> 2",))
