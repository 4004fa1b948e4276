"""Whole runs on synthetic scenes: what is promised of caching, seen from outside."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

from semidense.pipeline import api
from semidense.pipeline.api import Task
from semidense.pipeline.execution.scheduler import totals
from semidense.pipeline.results.result import Result
from semidense.stages.catalog import STAGES
from semidense.stages.disparity.aggregation.stage import compute_aggregated, compute_right_aggregated
from semidense.stages.disparity.declaration import AggregatedParams
from tests.stages.tiling import same
from tests.tiny import PATH

Invoke = Callable[..., Any]


def made(result: Result) -> dict[str, int]:
    """How many results of each product a run made."""
    return {product: fresh for product, (_, fresh) in totals(result.made.values()).items() if fresh}


def digests(result: Result) -> dict[tuple[str, str], tuple[str, str]]:
    return {(each.step.product, each.step.scene): (each.key, each.digest) for each in result.made.values()}


def test_a_run_makes_every_product_of_every_scene(trained: Result) -> None:
    three = dict.fromkeys(("images", "truth", "channels", "costvolume", "disparity"), 3)
    assert made(trained) == dict.fromkeys(PATH, 1) | three | {"right_disparity": 2}, "those are trained on"


@pytest.mark.parametrize(
    "product", sorted({name for name in PATH if name in STAGES and STAGES[name].scope == "scene"} - {"right_disparity"})
)
def test_every_array_is_as_declared(trained: Result, product: str) -> None:
    dataset = trained.store.open(trained.find(product, "test-0").key)
    for output in STAGES[product].outputs:
        array = dataset[output.name]
        assert array.dims == output.dims
        assert array.dtype == (output.dtype or array.dtype)
        assert array.attrs["units"] == output.units


def test_the_second_run_finds_all_and_computes_nothing(
    trained: Result, trained_task: Task, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("something was computed")

    monkeypatch.setattr("dask.threaded.get", refuse)
    again = api.run(trained_task)
    assert made(again) == {}
    assert digests(again) == digests(trained)
    assert again.metrics == trained.metrics


def test_the_filtered_map_is_the_raw_one_where_it_is_trusted(trained: Result) -> None:
    raw, kept, trust = (
        trained.open(product, "test-0")[name].values
        for product, name in (("disparity", "disparity"), ("semidense", "disparity"), ("confidence", "confidence"))
    )
    assert np.array_equal(kept, np.where(trust >= np.float32(0.9), raw, np.nan), equal_nan=True)
    assert np.nanmin(trust) >= 0
    assert np.nanmax(trust) <= 1


@pytest.mark.parametrize("setting", ["semidense.R=0", "disparity.subpixel=true"], ids=lambda text: text)
def test_a_dry_run_is_what_the_run_then_does(own_task: Task, setting: str) -> None:
    task = replace(own_task, settings=(*own_task.settings, setting))
    plan = api.status(task)
    result = api.run(task)
    assert [planned.step.id for planned in plan.steps] == list(result.made)
    assert [(planned.step.name, planned.state == "hit") for planned in plan.steps] == [
        (each.step.name, each.reused) for each in result.made.values()
    ]
    assert all(planned.key in (None, result.made[planned.step.id].key) for planned in plan.steps)


def test_a_run_goes_on_from_where_another_stopped(weights: Path, tmp_path: Path, trained: Result) -> None:
    task = Task("synthetic:train=0,test=1,height=64,width=80,disparities=8", cache=tmp_path / "cache")
    first = api.run(task, "costvolume")
    assert made(first) == dict.fromkeys(("images", "channels", "matching_net", "costvolume"), 1)
    assert first.metrics == []
    second = api.run(task)
    assert not {"images", "channels", "matching_net", "costvolume"} & set(made(second))
    assert second.find("metrics").digest == trained.find("metrics").digest


def test_a_sweep_touches_nothing_above_the_filter_and_says_so(invoke: Invoke, own_task: Task, tmp_path: Path) -> None:
    options = [text for setting in own_task.settings for text in ("--set", setting)]
    shared = [own_task.dataset, "--train", "--cache", str(own_task.cache)]
    store = api.open_store(own_task.cache)
    before = {entry.key for entry in store.entries()}
    ran = invoke("sweep", *shared, *options, "--R", "0.1:0.9:0.1", "-o", tmp_path / "sweep")
    assert ran.code == 0, ran.err
    # 0.9, the default, is there; maps of two thresholds that come out alike share their metrics
    assert re.fullmatch(r"reused \d+ products, made 8 semidense, \d+ metrics", ran.out.splitlines()[-1])
    fresh = {entry.label["product"] for entry in store.entries() if entry.key not in before}
    assert fresh <= {"semidense", "metrics"}


def test_a_sweep_over_a_setting_makes_every_combination(own_task: Task) -> None:
    settings = ("disparity.subpixel=false,true",)
    result = api.sweep(own_task, "0.5,0.9", settings)
    assert {row["variant"] for row in result.metrics} == {
        f"semidense.R={R}, disparity.subpixel={choice}" for R in ("0.5", "0.9") for choice in ("false", "true")
    }
    assert made(result)["semidense"] == 3, "one of the four is there"


def test_a_forced_product_is_made_again_and_equal(own_task: Task, trained: Result) -> None:
    result = api.run(own_task, forced=["channels", "evaluation_net"])
    assert made(result) == {"channels": 3, "evaluation_net": 1}
    assert digests(result) == digests(trained)


def test_the_number_of_workers_changes_no_key_and_no_digest(
    trained_task: Task, trained: Result, tmp_path: Path
) -> None:
    task = replace(trained_task, cache=tmp_path / "cache")
    assert digests(api.run(task, "disparity", workers=1)).items() <= digests(trained).items()


def test_one_row_a_tile_or_all_at_once_is_the_same(
    weights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The runner's tiles of the real stages: other keys, since the tiling is in them, and the same numbers.

    Costs in float32, as far as float16 tells: where a tile of transformed cells begins follows the runner's tile, and
    with it the roundings, which in bfloat16 are larger.
    """
    from semidense.pipeline.plan import building

    scene = "synthetic:train=0,test=1,height=64,width=80,disparities=8"
    task = Task(scene, settings=("costvolume.precision=float32",), cache=tmp_path / "usual")
    usual = api.run(task, "semidense")
    for rows in (13, 64):
        cut = {name: replace(stage, tile_rows=stage.tile_rows and rows) for name, stage in STAGES.items()}
        monkeypatch.setattr(building, "STAGES", cut)
        result = api.run(replace(task, cache=tmp_path / str(rows)), "semidense")
        for product, name in (("channels", "channels"), ("costvolume", "cost"), ("disparity", "disparity")):
            found, expected = (
                np.asarray(each.store.arrays(each.find(product, "test-0").key)[name][...]) for each in (result, usual)
            )
            if product == "costvolume":
                assert np.array_equal(np.isnan(found), np.isnan(expected))
                unit = 2.0**-10 * float(np.nanmax(np.abs(expected)))
                assert np.nanmax(np.abs(found.astype(np.float64) - expected)) <= unit, rows
            elif product == "disparity":
                assert np.mean(found != expected) <= 0.001, "but for ties"
            else:
                assert np.array_equal(found, expected, equal_nan=True), (product, rows)
        array: zarr.Array = result.store.arrays(result.find("disparity").key)["disparity"]
        assert array.chunks[0] == min(rows, 64)


def test_nothing_is_left_in_drafts_or_checkpoints(trained: Result) -> None:
    root = trained.store.root
    left = [
        path for folder in ("drafts", "checkpoints") if (root / folder).is_dir() for path in (root / folder).iterdir()
    ]
    assert left == []


def test_aggregated_maps_take_the_place_of_both_views_maps(own_task: Task) -> None:
    settings = (
        *own_task.settings,
        "use.disparity=aggregated",
        "use.right_disparity=right_aggregated",
        "refined.left_right=true",
        "aggregated.p1=2",
        "aggregated.p2=9",
    )
    result = api.run(replace(own_task, settings=settings), "refined")
    arrays = {name: result.store.read(result.find(name, "test-0").key) for name in ("images", "costvolume")}
    params = AggregatedParams(p1=2, p2=9)
    for product, compute in (("disparity", compute_aggregated), ("right_disparity", compute_right_aggregated)):
        assert same(result.store.read(result.find(product, "test-0").key), compute(params, arrays))


def test_a_sweep_over_penalties_makes_the_volume_once(own_task: Task) -> None:
    settings = (*own_task.settings, "use.disparity=aggregated")
    result = api.sweep(replace(own_task, settings=settings), "0.5", ["aggregated.p1=1,2,4"])
    assert made(result)["disparity"] == 9, "three scenes, three penalties"
    assert "costvolume" not in made(result)
