"""Small products of a scene are made in one task, with the same results and promises as in many."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from semidense.cache import CacheUnavailable, NonDeterministicStage, Store
from semidense.pipeline.execution import batch
from semidense.pipeline.execution.batch import make_all
from semidense.pipeline.execution.claims import Claims, LocalClaims, RunStopped
from semidense.pipeline.execution.jobs import Context
from semidense.pipeline.execution.scheduler import execute
from semidense.pipeline.execution.watch import Unwatched
from semidense.pipeline.plan.errors import StageFailed, StageRefused
from semidense.pipeline.plan.plan import Made, Plan
from semidense.pipeline.plan.steps import Step
from semidense.stages.stage import Arrays, Inputs
from tests.pipeline.execution.test_graph import COUNT, scene, scenes
from tests.pipeline.toy import BLURRED, CALLS, RAMP, graph, step

ToyPlan = Callable[..., Plan]


@pytest.fixture
def context(store: Store) -> Iterator[Context]:
    with store.lease() as lease:
        yield Context(store, Unwatched(), {}, Claims(lease))


def all_of(context: Context, steps: tuple[Step, ...], *inputs: Made, forced: str = "") -> list[Made]:
    return make_all(context, steps, inputs, {forced})


def test_each_product_of_a_batch_is_told_when_it_is_published(toy_plan: ToyPlan, store: Store) -> None:
    told: list[tuple[str, str]] = []

    class Seen(Unwatched):
        def published(self, made: Made) -> None:
            assert store.find(made.key)
            told.append((made.step.scene, made.step.product))

    execute(toy_plan(scenes()), store, Seen(), {}, workers=2)
    assert sorted(told) == sorted((f"Toy {n}", product) for n in range(COUNT) for product in ("ramp", "blurred", "sum"))


def test_nothing_of_a_batch_is_there_before_all_of_it(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    there, real = [], Store.publish_all

    def look(store: Store, results: Any, lease: Any) -> Any:  # noqa: ANN401
        there.append((len(results), len(list(store.entries())), list(store.layout.drafts.iterdir())))
        return real(store, results, lease)

    monkeypatch.setattr(Store, "publish_all", look)
    made = all_of(context, scene(1))
    assert there == [(3, 0, [])]
    assert [context.store.require(each.key).digest for each in made] == [each.digest for each in made]


def test_a_scene_that_fails_is_named_and_what_was_made_is_kept(
    toy_plan: ToyPlan, store: Store, drafts: Callable[[], list[str]]
) -> None:
    broken = replace(BLURRED, compute="tests.pipeline.toy:fail_below")
    steps = [each for number in range(COUNT) for each in (scene(number, broken) if number == 5 else scene(number))]
    with pytest.raises(StageFailed, match=r"^blurred of Toy 5, rows 0-3: RuntimeError: the fourth row broke it$"):
        execute(toy_plan(graph(*steps)), store, Unwatched(), {}, workers=1)
    assert drafts() == []
    kept = {(entry.label["scene"], entry.label["product"]) for entry in store.entries()}
    assert ("Toy 5", "ramp") in kept
    assert ("Toy 5", "blurred") not in kept
    CALLS.clear()
    execute(toy_plan(scenes()), store, Unwatched(), {}, workers=2)
    assert len(CALLS) == 5 * COUNT - sum({"ramp": 1, "blurred": 3, "sum": 1}[product] for _, product in kept)


def test_a_batch_whose_worker_died_is_made_again(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    class Killed(BaseException):
        pass

    def die(*_: object) -> None:
        raise Killed

    monkeypatch.setattr(Store, "publish_all", die)
    with pytest.raises(Killed):
        all_of(context, scene(1))
    monkeypatch.undo()
    CALLS.clear()
    made = all_of(context, scene(1))
    assert ["ramp", *["blurred"] * 3, "sum"] == CALLS
    assert tuple(each.step for each in made) == scene(1)
    assert not any(each.reused for each in made)
    assert list(context.store.layout.drafts.iterdir()) == []


def test_a_batch_whose_worker_died_in_publishing_goes_on_from_what_is_there(context: Context) -> None:
    first = all_of(context, scene(1)[:2])
    CALLS.clear()
    made = all_of(context, scene(1))
    assert CALLS == ["sum"]
    assert made[:2] == first


@pytest.mark.parametrize("tile_rows", [4, 16])
def test_a_batch_reads_nothing_again_that_it_just_made(
    context: Context, monkeypatch: pytest.MonkeyPatch, tile_rows: int
) -> None:
    opened, real = [], Store.arrays
    monkeypatch.setattr(Store, "arrays", lambda self, key: opened.append(key) or real(self, key))
    made = all_of(context, scene(1, replace(BLURRED, tile_rows=tile_rows)))
    assert opened == []
    assert context.recent.open(context.store, made[0].key)["values"].dims == ("y", "x")
    for each in made:
        kept, read = context.recent.read(context.store, each.key), context.store.read(each.key)
        assert {name: (each.tobytes(), each.strides) for name, each in kept.items()} == {
            name: (each.tobytes(), each.strides) for name, each in read.items()
        }


def test_what_is_handed_on_is_a_copy_as_it_would_be_read(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stage may go on using the array that it returned, and may change what it is given."""
    returned: list[Any] = []

    def call(step: Step, inputs: Inputs) -> Arrays:
        for given in inputs.values():
            given["values"][...] = -1
        returned.append(np.asfortranarray(np.arange(40.0).reshape(10, 4)))
        return {"values": returned[-1]}

    monkeypatch.setattr(batch.tasks, "call", call)
    ramp = step(RAMP, 0)
    made = all_of(context, (ramp, step(RAMP, 1, ramp=ramp)))
    returned[0][...] = 7
    kept = context.recent.read(context.store, made[0].key)["values"]
    assert kept.flags.c_contiguous
    np.testing.assert_array_equal(kept, np.arange(40.0).reshape(10, 4))
    np.testing.assert_array_equal(context.store.read(made[0].key)["values"], kept)


def test_a_batch_of_many_products_is_published_in_parts(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    parts, real = [], Store.publish_all
    monkeypatch.setattr(batch, "MOST_BYTES", 0)
    monkeypatch.setattr(Store, "publish_all", lambda *given: parts.append(len(given[1])) or real(*given))
    made = all_of(context, scene(1))
    assert parts == [1, 1, 1]
    monkeypatch.undo()
    assert [each.digest for each in made] == [each.digest for each in all_of(context, scene(1), forced="blurred")]


def test_equal_steps_of_a_batch_are_made_once(context: Context) -> None:
    ramp, blurred, total = scene(1)
    twin = replace(blurred, id="twin")
    made = all_of(context, (ramp, blurred, twin, total))
    assert CALLS.count("blurred") == 3
    assert (made[1].key, made[1].digest, made[1].reused) == (made[2].key, made[2].digest, made[2].reused)


def test_a_tile_of_another_shape_is_refused(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    ramp, blurred, _ = scene(1)
    (there,) = all_of(context, (ramp,))
    monkeypatch.setattr(batch.tasks, "compute_tile", lambda *_: {"values": np.zeros((1, 4))})
    with pytest.raises(StageRefused, match=r"^blurred of Toy 1, rows 0-3: .*the shape \(1, 4\), its place \(4, 4\)"):
        all_of(context, (blurred,), there)


def test_a_forced_product_that_differs_is_refused_and_named(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    all_of(context, scene(1))
    monkeypatch.setattr(batch.tasks, "call", lambda *_: {"values": np.zeros((10, 4))})
    with pytest.raises((StageFailed, StageRefused), match=r"products of Toy 1: ramp gave two results") as caught:
        all_of(context, scene(1)[:1], forced="ramp")
    assert isinstance(caught.value.__cause__, NonDeterministicStage)


def test_a_cache_that_refuses_is_told_and_gives_the_claim_back(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise CacheUnavailable("no space left")

    monkeypatch.setattr(Store, "publish_all", refuse)
    with store.lease() as lease:
        claims = LocalClaims(lease, store, 1)
        with pytest.raises(StageRefused, match=r"^products of Toy 1: no space left$"):
            all_of(Context(store, Unwatched(), {}, claims), scene(1))
        assert [path.name for path in store.layout.locks.iterdir()] == []


def test_one_claim_stands_for_a_batch(store: Store) -> None:
    held: list[list[str]] = []

    class Seen(Unwatched):
        def begun(self, step: Step, tiles: int) -> None:
            held.append([path.name.partition(".")[0] for path in store.layout.locks.glob("*.making")])

    with store.lease() as lease:
        made = all_of(Context(store, Seen(), {}, LocalClaims(lease, store, 1)), scene(1))
    assert held == [[made[0].key]] * 3
    assert list(store.layout.locks.iterdir()) == []


def test_a_batch_ends_with_its_run(store: Store) -> None:
    with store.lease() as lease:
        context = Context(store, Unwatched(), {}, Claims(lease))
    with pytest.raises(RunStopped):
        all_of(context, scene(1))
    assert CALLS == []


@pytest.mark.parametrize("last", ["blurred", "sum"])
def test_a_run_that_was_stopped_makes_and_publishes_nothing_more(store: Store, last: str) -> None:
    with store.lease() as lease:
        claims = LocalClaims(lease, store, 1)

        class Stops(Unwatched):
            def begun(self, step: Step, tiles: int) -> None:
                if step.product == last:
                    claims.stop()

        with pytest.raises(RunStopped):
            all_of(Context(store, Stops(), {}, claims), scene(1))
        assert list(store.entries()) == []
        assert ("sum" in CALLS) == (last == "sum")
