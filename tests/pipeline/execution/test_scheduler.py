import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semidense.cache import NonDeterministicStage, Store
from semidense.cache.entries import publish
from semidense.pipeline.execution.scheduler import execute, threads_of, totals
from semidense.pipeline.execution.watch import Unwatched
from semidense.pipeline.plan.errors import StageFailed, StageRefused, UsageError
from semidense.pipeline.plan.plan import Made, Plan
from semidense.pipeline.plan.steps import Graph
from semidense.stages.stage import Stage
from tests.pipeline import toy
from tests.pipeline.toy import BLURRED, CALLS, RAMP, SUM, WIDTH, Offset, chain, graph, states, step

ToyPlan = Callable[..., Plan]
ToyRun = Callable[..., dict[str, Made]]
Drafts = Callable[[], list[str]]


def values(store: Store, made: Made, name: str = "values") -> Any:  # noqa: ANN401
    return np.asarray(store.arrays(made.key)[name][...])


def test_a_run_makes_what_the_functions_say(toy_run: ToyRun, store: Store, drafts: Drafts) -> None:
    made = toy_run(chain(start=3, offset=2))
    ramp = np.arange(3, 43, dtype=np.float32).reshape(10, 4)
    assert np.array_equal(values(store, made["ramp"]), ramp)
    assert np.array_equal(values(store, made["blurred"]), ramp + 2)
    assert values(store, made["sum"], "sum") == ramp.sum() + 2 * ramp.size
    assert not any(each.reused for each in made.values())
    assert drafts() == []


def test_a_tiled_stage_runs_once_a_tile_and_writes_what_has_no_rows_once(toy_run: ToyRun, store: Store) -> None:
    made = toy_run(chain(offset=7))
    assert sorted(CALLS) == ["blurred"] * 3 + ["ramp", "sum"], "10 rows in tiles of 4"
    assert values(store, made["blurred"], "level").tolist() == [7]
    assert store.arrays(made["blurred"].key)["values"].chunks == (4, 4)


@pytest.mark.parametrize(("chunks", "tiles"), [(1, 3), (2, 2), (3, 1), (9, 1)])
def test_a_tile_can_make_several_chunks(toy_run: ToyRun, store: Store, chunks: int, tiles: int) -> None:
    """There are fewer tasks, and the same files."""
    usual = toy_run(chain(reach=1))["blurred"]
    CALLS.clear()
    wide = replace(BLURRED, chunks_a_tile=lambda params, width: params.reach * chunks * width // WIDTH)
    made = toy_run(chain(reach=1, code="2e", stage=wide))["blurred"]
    assert CALLS.count("blurred") == tiles == made.step.tiles
    assert (made.digest, made.key != usual.key) == (usual.digest, True)


@pytest.mark.parametrize("rows", [1, 3, 4, 9, 10, 64])
@pytest.mark.parametrize("reach", [0, 1, 3])
def test_tiles_are_the_whole(toy_run: ToyRun, store: Store, rows: int, reach: int) -> None:
    made = toy_run(chain(reach=reach, stage=replace(BLURRED, tile_rows=rows)))
    ramp = toy.make_ramp(0, {})["values"]
    whole = toy.make_blurred(Offset(reach=reach), {"ramp": {"values": ramp}})["values"]
    assert np.array_equal(values(store, made["blurred"]), whole)


@pytest.mark.parametrize("rows", [1, 4, 10])
def test_tiles_with_a_border_of_their_own_are_the_whole(toy_run: ToyRun, store: Store, rows: int) -> None:
    shrunk = replace(BLURRED, compute="tests.pipeline.toy:make_shrunk", border="edge", tile_rows=rows)
    made = toy_run(chain(reach=2, stage=shrunk))
    padded = np.pad(toy.make_ramp(0, {})["values"], 2, mode="edge")
    expected = np.lib.stride_tricks.sliding_window_view(padded, (5, 5)).sum(axis=(2, 3))
    assert np.array_equal(values(store, made["blurred"]), expected)


def test_threads_and_a_scheduler_exclude_each_other(toy_plan: ToyPlan, store: Store) -> None:
    message = r"--workers 3 counts threads.*--scheduler processes:1 works with other ones: leave one out; processes:3 "
    with pytest.raises(UsageError, match=message):
        execute(toy_plan(chain()), store, Unwatched(), {}, "processes:1", 3)
    with pytest.raises(UsageError, match=message):
        threads_of("processes:1", 3)
    assert CALLS == []


def test_the_number_of_workers_changes_nothing(toy_plan: ToyPlan, tmp_path: Path) -> None:
    plan = toy_plan(chain(reach=1))
    runs = [execute(plan, Store(tmp_path / str(count)), Unwatched(), {}, workers=count) for count in (1, 2, 5)]
    found = [{(each.key, each.digest) for each in made.values()} for made in runs]
    assert found[0] == found[1] == found[2]


@pytest.fixture
def no_dask(monkeypatch: pytest.MonkeyPatch) -> None:
    """Raise if anything is computed."""

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("something was computed")

    monkeypatch.setattr("dask.threaded.get", refuse)
    monkeypatch.setattr(Store, "begin", refuse)
    monkeypatch.setattr(Stage, "function", refuse)


def test_where_all_is_a_hit_nothing_is_computed(toy_run: ToyRun, request: pytest.FixtureRequest) -> None:
    first = toy_run(chain())
    request.getfixturevalue("no_dask")
    again = toy_run(chain())
    assert all(each.reused for each in again.values())
    assert {product: each.digest for product, each in again.items()} == {p: each.digest for p, each in first.items()}


def test_the_guard_against_computing_works(toy_run: ToyRun, no_dask: None) -> None:
    with pytest.raises(AssertionError, match="something was computed"):
        toy_run(chain())


def test_only_what_is_missing_runs(toy_run: ToyRun) -> None:
    toy_run(chain(offset=1))
    CALLS.clear()
    made = toy_run(chain(offset=2))
    assert sorted(CALLS) == ["blurred", "blurred", "blurred", "sum"]
    assert {product: each.reused for product, each in made.items()} == {"ramp": True, "blurred": False, "sum": False}


def clipped(start: int) -> Graph:
    """A middle product that comes out the same wherever above zero the ramp starts."""
    ramp = step(RAMP, start)
    clip = replace(RAMP, product="blurred", inputs=("ramp",), compute="tests.pipeline.toy:make_clipped")
    middle = step(clip, ramp=ramp)
    return graph(ramp, middle, step(SUM, blurred=middle))


def test_below_what_comes_out_unchanged_everything_is_reused(toy_plan: ToyPlan, toy_run: ToyRun) -> None:
    toy_run(clipped(1))
    assert states(toy_plan(clipped(2))) == dict.fromkeys(("ramp", "blurred", "sum"), "stale")
    CALLS.clear()
    made = toy_run(clipped(2))
    assert CALLS == ["ramp", "clipped"]
    assert {product: each.reused for product, each in made.items()} == {"ramp": False, "blurred": False, "sum": True}


def test_a_forced_product_runs_and_what_it_feeds_is_reused(toy_run: ToyRun) -> None:
    first = toy_run(chain())
    CALLS.clear()
    made = toy_run(chain(), "ramp")
    assert CALLS == ["ramp"]
    assert {product: each.reused for product, each in made.items()} == {"ramp": False, "blurred": True, "sum": True}
    assert made["ramp"].key == first["ramp"].key


def test_a_forced_product_that_comes_out_differently_is_an_error(
    toy_run: ToyRun, monkeypatch: pytest.MonkeyPatch, drafts: Drafts
) -> None:
    toy_run(chain())
    real = toy.make_ramp
    monkeypatch.setattr(toy, "make_ramp", lambda start, inputs: real(start + 1, inputs))
    with pytest.raises(StageRefused, match="ramp of Toy: ") as caught:
        toy_run(chain(), "ramp")
    assert isinstance(caught.value.__cause__, NonDeterministicStage)
    assert drafts() == []


def failing(compute: str) -> Graph:
    return chain(stage=replace(BLURRED, compute=f"tests.pipeline.toy:{compute}"))


def test_a_failing_tile_is_named_with_its_cause(toy_run: ToyRun, toy_plan: ToyPlan, drafts: Drafts) -> None:
    with pytest.raises(StageFailed) as caught:
        toy_run(failing("fail_below"))
    assert str(caught.value) in (
        "blurred of Toy, rows 4-7: RuntimeError: the fourth row broke it",
        "blurred of Toy, rows 8-9: RuntimeError: the fourth row broke it",
    )
    assert isinstance(caught.value.__cause__, RuntimeError)
    assert drafts() == [], "nothing half-made is left"
    assert states(toy_plan(chain()))["ramp"] == "hit", "what was made before is kept"


def test_what_a_stage_refuses_is_a_user_s_error(toy_run: ToyRun, drafts: Drafts) -> None:
    with pytest.raises(StageRefused, match=r"^blurred of Toy, rows \d-\d: these values are no good$"):
        toy_run(failing("refuse"))
    assert drafts() == []


def test_a_failed_run_goes_on_where_it_stopped(toy_run: ToyRun) -> None:
    with pytest.raises(StageFailed):
        toy_run(failing("fail_below"))
    CALLS.clear()
    toy_run(chain())
    assert "ramp" not in CALLS


def test_nothing_is_written_after_a_failure(
    toy_run: ToyRun, store: Store, monkeypatch: pytest.MonkeyPatch, drafts: Drafts
) -> None:
    """A sibling that is still at work when a tile fails must not bring its draft back."""
    failed, slow_is_in = threading.Event(), threading.Event()

    def one_slow_one_broken(params: Offset, inputs: Any) -> Any:  # noqa: ANN401
        if inputs["ramp"]["values"].min() == 0:
            slow_is_in.set()
            failed.wait(5)
            return toy.make_blurred(params, inputs)
        slow_is_in.wait(5)
        failed.set()
        raise RuntimeError("broken")

    monkeypatch.setattr(toy, "fail_below", one_slow_one_broken)
    with pytest.raises(StageFailed):
        toy_run(failing("fail_below"), workers=3)
    assert drafts() == []
    assert [entry.label["product"] for entry in store.entries()] == ["ramp"]


@pytest.mark.parametrize("step", ["begun", "array created", "chunk written"])
def test_an_interrupted_run_leaves_no_draft(
    step: str, toy_run: ToyRun, monkeypatch: pytest.MonkeyPatch, drafts: Drafts
) -> None:
    """Also not one that was just being begun, and of which the run did not know yet."""

    def interrupt(done: str) -> None:
        if done == step:
            monkeypatch.undo()
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.2)

    monkeypatch.setattr(publish, "STEP_HOOK", interrupt)
    with pytest.raises(KeyboardInterrupt):
        toy_run(chain())
    assert drafts() == []


def test_a_damaged_entry_is_set_aside_and_made_again(toy_run: ToyRun, store: Store) -> None:
    first = toy_run(chain())
    folder = store.layout.entry(first["blurred"].key)
    chunk = next(path for path in sorted(folder.rglob("c/*/*")) if path.is_file())
    chunk.chmod(0o600)
    data = bytearray(chunk.read_bytes())
    data[-1] ^= 1
    chunk.write_bytes(data)
    made = toy_run(chain())
    assert {product: each.reused for product, each in made.items()} == {"ramp": True, "blurred": False, "sum": True}
    assert made["blurred"].digest == first["blurred"].digest
    assert store.check(made["blurred"].key) is None
    assert len([path for path in store.layout.quarantine.iterdir() if path.is_dir()]) == 1


def test_results_come_in_the_order_of_the_plan(toy_plan: ToyPlan, store: Store) -> None:
    plan = toy_plan(chain())
    made = execute(plan, store, Unwatched(), {})
    assert list(made) == [planned.step.id for planned in plan.steps]


def test_extras_are_stored_beside_each_result(toy_plan: ToyPlan, store: Store) -> None:
    made = execute(toy_plan(chain()), store, Unwatched(), {"command": ["x"]})
    assert {store.require(each.key).extras["command"][0] for each in made.values()} == {"x"}


def test_drafts_of_the_dead_are_swept(toy_run: ToyRun, store: Store, drafts: Drafts) -> None:
    toy_run(chain())
    store.layout.draft("0f" * 16, "ab" * 32, "").mkdir(parents=True)
    toy_run(chain())
    assert drafts() == []


def test_totals_count_what_was_there_and_what_was_made(toy_run: ToyRun) -> None:
    toy_run(chain(offset=1))
    assert totals(toy_run(chain(offset=2)).values()) == {"ramp": (1, 0), "blurred": (0, 1), "sum": (0, 1)}
