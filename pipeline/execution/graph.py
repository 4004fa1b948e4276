"""Turn a plan into Dask tasks: one or more a product, or for a data set of small scenes one for many products."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from math import prod
from typing import Any
from uuid import uuid4

from semidense.pipeline.execution import tasks
from semidense.pipeline.execution.batch import make_all
from semidense.pipeline.execution.jobs import Context
from semidense.pipeline.execution.tiles import cut_rows
from semidense.pipeline.plan.plan import Made, Plan, Planned
from semidense.pipeline.plan.steps import Step

Tasks = tuple[Mapping[str, Any], Sequence[str]]
"""Dask's tasks by key, and the keys of those whose results are wanted: each a ``Made``, or several."""

SMALL = 1 << 18
"""A product of at most so many bytes can be made in one task with others of its scene."""
MANY = 8
"""So many scenes with small products keep all threads busy; of fewer, each product and tile has a task of its own."""
_PIXEL = 16
"""Bytes a pixel of a product whose arrays do not declare their size."""


def make_graph(plan: Plan, context: Context) -> Tasks:
    """Return the tasks of a plan.

    The tasks are of Dask's own kind: ``dask.delayed`` goes through all that comes before a task whenever one is added.
    """
    graph: dict[str, Any] = {}
    shared = _add_value(graph, "context", context)
    results: dict[str, Any] = {}
    for planned in plan.steps:
        if planned.state == "hit":
            results[planned.step.id] = _add_value(graph, planned.step.product, there(planned))
    for steps in batches(plan.todo()):
        if len(steps) > 1:
            made = _add_batch(graph, steps, plan, shared, results)
        else:
            made = _add_step(graph, steps[0], plan, shared, results)
        results.update((step.id, made) for step in steps)
    return graph, list(dict.fromkeys(results[planned.step.id].key for planned in plan.steps))


def there(planned: Planned) -> Made:
    """Return the result of a step that the plan found in the cache."""
    return Made(planned.step, str(planned.key), str(planned.digest), planned.seconds or 0.0, reused=True)


def batches(todo: Iterable[Planned]) -> list[list[Step]]:
    """Return the steps to make, in an order in which each comes after its inputs: small ones of a scene together.

    What is made from a large product, or from one of all scenes, comes in a later batch than what that is made from.
    So no batch waits for itself.
    """
    steps = [planned.step for planned in todo]
    small = {step.id: _is_small(step) for step in steps}
    if len({step.scene for step in steps if small[step.id]}) < MANY:
        return [[step] for step in steps]
    turns: dict[str, int] = {}  # small products have even ones, others odd ones
    found: dict[tuple[int, str], list[Step]] = {}
    for step in steps:
        own = small[step.id]
        before = [each for ids in step.inputs.values() for each in ids if each in turns]
        turns[step.id] = turn = max([0 if own else -1, *(turns[each] + (small[each] != own) for each in before)])
        found.setdefault((turn, step.scene if own else step.id), []).append(step)
    return [found[place] for place in sorted(found, key=lambda place: place[0])]


def _is_small(step: Step) -> bool:
    if step.size is None or step.stage.monitored:
        return False
    return (step.declared_bytes or _PIXEL * prod(step.size)) <= SMALL


def _add_value(graph: dict[str, Any], name: str, value: Any) -> Any:  # noqa: ANN401
    """Add a value that tasks share, and return what refers to it."""
    from dask._task_spec import DataNode, TaskRef

    key = f"{name}-{uuid4().hex}"
    graph[key] = DataNode(key, value)
    return TaskRef(key)


def _add_task(graph: dict[str, Any], product: str, function: Any, *arguments: Any) -> Any:  # noqa: ANN401
    """Add a task, and return what refers to its result."""
    from dask._task_spec import Task, TaskRef

    # Dask's profilers and dashboard show the key; it is new each time, for a cluster keeps results by it.
    key = f"{product}-{function.__name__}-{uuid4().hex}"
    graph[key] = Task(key, function, *arguments)
    return TaskRef(key)


def _inputs(steps: Sequence[Step], results: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Return what refers to the results that some steps are made from, those of these steps left out."""
    from dask._task_spec import List

    own = {step.id for step in steps}
    ids = (each for step in steps for ids in step.inputs.values() for each in ids if each not in own)
    return List(*{results[each].key: results[each] for each in ids}.values())


def _add_batch(graph: dict[str, Any], steps: list[Step], plan: Plan, shared: Any, results: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Add the task of several steps of a scene, and return what refers to its list of ``Made``."""
    own, inputs = _add_value(graph, "steps", steps), _inputs(steps, results)
    return _add_task(graph, "small scenes", make_all, shared, own, inputs, plan.forced)


def _add_step(graph: dict[str, Any], step: Step, plan: Plan, shared: Any, results: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Add the tasks of a step, and return what refers to its ``Made``."""
    from dask._task_spec import List

    add = partial(_add_task, graph, step.product)
    own, forced = _add_value(graph, step.product, step), step.product in plan.forced
    job = add(tasks.begin, shared, own, _inputs([step], results), forced, step.tiles)
    if step.tile_rows is None or step.size is None:
        parts = [add(tasks.make_whole, shared, job)]
    else:
        ready = add(tasks.create_arrays, job)
        rows = cut_rows(step.size[0], step.tile_rows)
        parts = [add(tasks.make_tile, shared, ready, _add_value(graph, "rows", each)) for each in rows]
    return add(tasks.publish, shared, job, List(*parts))
