"""Small scenes are made in few tasks, with the same results and promises as in many."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from semidense.cache import Store
from semidense.pipeline.execution import graph as graphs
from semidense.pipeline.execution.claims import Claims
from semidense.pipeline.execution.graph import MANY, SMALL, batches, make_graph
from semidense.pipeline.execution.jobs import Context
from semidense.pipeline.execution.scheduler import execute
from semidense.pipeline.execution.watch import Unwatched
from semidense.pipeline.plan.plan import Plan, Planned
from semidense.pipeline.plan.steps import SPLIT, Graph, Step
from semidense.stages.stage import Output
from tests.pipeline.toy import BLURRED, RAMP, SUM, Offset, graph, step

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


def test_what_is_made_from_no_small_product_comes_first_and_keeps_no_scene_apart() -> None:
    shipped = replace(step(RAMP, "net", scene=SPLIT), size=None)
    last = [step(SUM, "last", scene=total.scene, blurred=total, net=shipped) for *_, total in map(scene, range(COUNT))]
    steps = [each for number, after in enumerate(last) for each in (*scene(number), after)]
    order = batches(todo(*steps[:3], shipped, *steps[3:]))
    assert [len(each) for each in order] == [1] + [4] * COUNT


def test_what_is_monitored_has_a_task_of_its_own() -> None:
    """Its states are kept for whoever goes on with it."""
    steps = [(*scene(number), step(replace(SUM, monitored=True), scene=f"Toy {number}")) for number in range(COUNT)]
    assert [len(each) for each in batches(todo(*(each for four in steps for each in four)))] == [1] * COUNT + [
        3
    ] * COUNT


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
