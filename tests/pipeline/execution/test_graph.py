"""Small scenes are made in few tasks, with the same results and promises as in many."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semidense.cache import Store
from semidense.pipeline.execution import graph as graphs
from semidense.pipeline.execution import tasks
from semidense.pipeline.execution.claims import Claims, RunStopped
from semidense.pipeline.execution.graph import MANY, SMALL, batches, make_graph
from semidense.pipeline.execution.jobs import Context, Job
from semidense.pipeline.execution.scheduler import execute
from semidense.pipeline.execution.watch import Unwatched
from semidense.pipeline.plan.errors import StageFailed
from semidense.pipeline.plan.plan import Made, Plan, Planned
from semidense.pipeline.plan.steps import SPLIT, Graph, Step
from semidense.stages.stage import Output
from tests.pipeline.toy import BLURRED, CALLS, RAMP, SUM, Offset, graph, step

ToyPlan = Callable[..., Plan]
COUNT = MANY + 2


def scene(number: int, stage: Any = BLURRED) -> tuple[Step, Step, Step]:  # noqa: ANN401
    ramp = step(RAMP, 100 * number, scene=f"Toy {number}")
    blurred = step(stage, Offset(reach=1, offset=number), scene=ramp.scene, ramp=ramp)
    return ramp, blurred, step(SUM, number, scene=ramp.scene, blurred=blurred)


def scenes(count: int = COUNT) -> Graph:
    return graph(*(each for number in range(count) for each in scene(number)))


@pytest.fixture
def context(store: Store) -> Iterator[Context]:
    with store.lease() as lease:
        yield Context(store, Unwatched(), {}, Claims(lease))


def functions(plan: Plan, context: Context) -> list[str]:
    tasks, _ = make_graph(plan, context)
    return sorted(key.rsplit("-", 2)[1] for key in tasks if key.count("-") == 2)


def test_a_task_makes_all_of_a_small_scene(toy_plan: ToyPlan, context: Context) -> None:
    assert functions(toy_plan(scenes()), context) == ["make_all"] * COUNT


def test_of_few_scenes_each_tile_has_a_task(toy_plan: ToyPlan, context: Context) -> None:
    made = functions(toy_plan(scenes(MANY - 1)), context)
    assert (made.count("make_tile"), made.count("publish")) == (3 * (MANY - 1), 3 * (MANY - 1))


def test_both_ways_give_the_same_results_in_the_order_of_the_plan(
    toy_plan: ToyPlan, store: Store, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    plan = toy_plan(scenes())
    made = execute(plan, store, Unwatched(), {}, workers=2)
    monkeypatch.setattr(graphs, "MANY", 1000)
    apart = execute(plan, Store(tmp_path / "apart"), Unwatched(), {}, workers=2)
    assert list(made) == list(apart) == [planned.step.id for planned in plan.steps]
    assert [(each.key, each.digest) for each in made.values()] == [(each.key, each.digest) for each in apart.values()]
    assert toy_plan(scenes()).todo() == ()


def test_each_product_of_a_batch_is_told_and_published_by_itself(toy_plan: ToyPlan, store: Store) -> None:
    told: list[tuple[str, str]] = []

    class Seen(Unwatched):
        def published(self, made: Made) -> None:
            assert store.find(made.key)
            told.append((made.step.scene, made.step.product))

    execute(toy_plan(scenes()), store, Seen(), {}, workers=2)
    assert sorted(told) == sorted((f"Toy {n}", product) for n in range(COUNT) for product in ("ramp", "blurred", "sum"))


def test_a_scene_that_fails_is_named_and_what_was_made_is_kept(
    toy_plan: ToyPlan, store: Store, drafts: Callable[[], list[str]]
) -> None:
    broken = replace(BLURRED, compute="tests.pipeline.toy:fail_below")
    steps = [each for number in range(COUNT) for each in (scene(number, broken) if number == 5 else scene(number))]
    with pytest.raises(StageFailed, match=r"^blurred of Toy 5, rows 0-3: the fourth row broke it$"):
        execute(toy_plan(graph(*steps)), store, Unwatched(), {}, workers=1)
    assert drafts() == []
    kept = {(entry.label["scene"], entry.label["product"]) for entry in store.entries()}
    assert ("Toy 5", "ramp") in kept
    assert ("Toy 5", "blurred") not in kept
    CALLS.clear()
    execute(toy_plan(scenes()), store, Unwatched(), {}, workers=2)
    assert len(CALLS) == 5 * COUNT - sum({"ramp": 1, "blurred": 3, "sum": 1}[product] for _, product in kept)


def test_a_batch_whose_worker_died_goes_on_where_that_stopped(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Killed(BaseException):
        pass

    steps, publish = scene(1), tasks.publish

    def die(context: Context, job: Job, spans: Any) -> Made:  # noqa: ANN401
        if job.step.product == "blurred":
            raise Killed
        return publish(context, job, spans)

    monkeypatch.setattr(tasks, "publish", die)
    with pytest.raises(Killed):
        tasks.make_all(context, steps, [], frozenset())
    assert CALLS == ["ramp", "blurred", "blurred", "blurred"]
    monkeypatch.undo()
    made = tasks.make_all(context, steps, [], frozenset())
    assert CALLS[4:] == ["sum"], "neither what was published nor tiles that were written are made again"
    assert tuple(each.step for each in made) == steps
    assert not any(each.reused for each in made)
    assert list(context.store.layout.drafts.iterdir()) == []


def test_a_batch_reads_nothing_again_that_it_just_made(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    opened, real = [], Store.arrays
    monkeypatch.setattr(Store, "arrays", lambda self, key: opened.append(key) or real(self, key))
    tasks.make_all(context, scene(1, replace(BLURRED, tile_rows=16)), [], frozenset())
    assert opened == []
    ramp, blurred, _ = tasks.make_all(context, scene(2), [], frozenset())
    assert opened == [blurred.key], "of several tiles no one holds the whole"
    assert context.recent.open(context.store, ramp.key)["values"].dims == ("y", "x")
    for key in (ramp.key, blurred.key):
        kept, read = context.recent.read(context.store, key), context.store.read(key)
        assert {name: (each.tobytes(), each.strides) for name, each in kept.items()} == {
            name: (each.tobytes(), each.strides) for name, each in read.items()
        }


def test_on_a_cluster_a_batch_reads_what_was_published(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker that was given up may have written into the same draft."""
    monkeypatch.setattr(Context, "admit", lambda *_: None)
    with store.lease() as lease:
        context = Context(store, Unwatched(), {}, Claims(lease), runner={})
        made = tasks.make_all(context, scene(1), [], frozenset())
    assert list(context.recent._kept) == [made[0].key, made[1].key], "each of them by reading"


def test_what_is_handed_on_is_a_copy_as_it_would_be_read() -> None:
    job, array = Job(scene(1)[0], {}, None, None, arrays={}), np.arange(6.0).reshape(2, 3).T
    job.hand_on(RAMP.outputs[0], array)
    array[:] = 0
    assert job.arrays is not None
    values = job.arrays["values"].values
    assert values[...].tolist() == [[0, 3], [1, 4], [2, 5]]
    assert isinstance(values, np.ndarray) and values.flags.c_contiguous


def test_a_batch_ends_with_its_run(store: Store) -> None:
    with store.lease() as lease:
        context = Context(store, Unwatched(), {}, Claims(lease))
    with pytest.raises(RunStopped):
        tasks.make_all(context, scene(1), [], frozenset())
    assert CALLS == []


def todo(*steps: Step) -> list[Planned]:
    return [Planned(each, "missing") for each in steps]


def test_a_batch_waits_for_nothing_that_is_made_from_it() -> None:
    """What is learnt from all scenes, and what is large, comes between two batches of a scene."""
    many = [scene(number) for number in range(COUNT)]
    sums = tuple(total.id for _, _, total in many)
    net = replace(step(SUM, "net", scene=SPLIT), inputs={"sum": sums}, size=None)
    large = [replace(step(RAMP, "large", scene=ramp.scene, ramp=ramp), size=(SMALL, 1)) for ramp, _, _ in many]
    last = [
        replace(step(SUM, "last", scene=each.scene, large=each), inputs={"large": (each.id,), "net": (net.id,)})
        for each in large
    ]
    after = [step(SUM, "after", scene=each.scene, last=each) for each in last]
    order = batches(todo(*(each for three in many for each in three), net, *large, *last, *after))
    assert [len(steps) for steps in order] == [3] * COUNT + [1] * (1 + COUNT) + [2] * COUNT
    there: set[str] = set()
    for steps in order:
        own = {each.id for each in steps}
        assert {each for one in steps for ids in one.inputs.values() for each in ids} <= there | own
        there |= own


def test_what_is_there_already_keeps_no_scene_apart() -> None:
    net = replace(step(SUM, "net", scene=SPLIT), size=None)
    many = [scene(number) for number in range(COUNT)]
    steps = [replace(each, inputs={**each.inputs, "net": (net.id,)}) for three in many for each in three]
    assert [len(each) for each in batches(todo(*steps))] == [3] * COUNT


@pytest.mark.parametrize(
    ("size", "dtype", "small"),
    [
        ((256, 256), "float32", True),
        ((257, 256), "float32", False),
        ((128, 128), None, True),
        ((129, 128), None, False),
    ],
)
def test_a_product_is_small_by_its_bytes(size: tuple[int, int], dtype: str | None, small: bool) -> None:
    stage = replace(RAMP, outputs=(Output("values", ("y", "x"), dtype, "px", "numbers"),))
    steps = [replace(step(stage, 0, scene=str(number)), size=size, id=f"{number}{part}") for number in range(COUNT)
             for part in "ab"]  # fmt: skip
    assert len(batches(todo(*steps))) == (COUNT if small else 2 * COUNT)
