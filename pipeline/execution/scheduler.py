"""Carry out a plan: its steps become Dask tasks, on this machine's threads or on a cluster."""

import os
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext, suppress
from functools import partial
from typing import Any
from uuid import uuid4

from semidense.cache import CacheUnavailable, Lease, Store
from semidense.pipeline.execution import tasks
from semidense.pipeline.execution.claims import Claims, LocalClaims
from semidense.pipeline.execution.cluster.deployment import count_threads
from semidense.pipeline.execution.cluster.proof import runner_code
from semidense.pipeline.execution.cluster.running import SETTLE_SECONDS, Tasks, run_on_cluster
from semidense.pipeline.execution.jobs import Context
from semidense.pipeline.execution.tiles import cut_rows
from semidense.pipeline.execution.watch import Unwatched, Watch
from semidense.pipeline.plan.plan import Made, Plan, Planned
from semidense.pipeline.plan.steps import Step


def execute(
    plan: Plan,
    store: Store,
    watch: Watch,
    extras: Mapping[str, Any],
    scheduler: str | None = None,
    workers: int | None = None,
    lease: Lease | None = None,
) -> dict[str, Made]:
    """Make what a plan lacks and return every step's result by its id.

    Args:
        plan: from ``make_plan``.
        store: the same cache.
        watch: told how it goes on; on a cluster only of products that are done.
        extras: stored beside each result.
        scheduler: where the tasks are carried out, see ``deployment.FORMS``; None for threads of this process.
        workers: threads; None for one a core.
        lease: that the plan's hits were added to; None if nobody cleans the cache meanwhile.

    Raises:
        StageRefused: if a stage refuses what it was given.
        StageFailed: if a stage fails; what was made before is kept, nothing half-made is left.
    """
    store.sweep_drafts()
    if not plan.todo():
        return {planned.step.id: _there(planned) for planned in plan.steps}
    watch.planned(plan, store)
    with nullcontext(lease) if lease else store.lease() as held:
        if scheduler:
            context = Context(store, Unwatched(), extras, Claims(held), runner=runner_code())
            code = {name: each for planned in plan.todo() for name, each in planned.step.code.items()}
            needed = {**code, **(context.runner or {})}
            return run_on_cluster(lambda: _graph(plan, context), needed, store, held, watch, scheduler)
        threads = threads_of(None, workers)
        return _on_threads(plan, Context(store, watch, extras, LocalClaims(held, store, threads)), threads)


def threads_of(scheduler: str | None, workers: int | None) -> int:
    """Return how many tasks a run carries out at a time, given what ``execute`` is given.

    Raises:
        UsageError: if no scheduler answers.
    """
    return count_threads(scheduler) if scheduler else workers or os.cpu_count() or 1


def _there(planned: Planned) -> Made:
    return Made(planned.step, str(planned.key), str(planned.digest), planned.seconds or 0.0, reused=True)


def _on_threads(plan: Plan, context: Context, threads: int) -> dict[str, Made]:
    from dask.threaded import get

    (graph, keys), lease = _graph(plan, context), context.claims.lease
    pool = ThreadPoolExecutor(threads)
    try:
        made: Sequence[Made] = get(graph, keys, pool=pool)
    except Exception:
        # The failed task's siblings go on for a while: what they write must not outlive the drafts.
        context.claims.stop()
        pool.shutdown(wait=True, cancel_futures=True)
        raise
    except BaseException:
        # A signal waits for nobody, but a write that is under way brings its folder back, once.
        context.claims.stop()
        _discard(lease)
        time.sleep(SETTLE_SECONDS)
        raise
    finally:
        context.claims.stop()
        _discard(lease)
        context.claims.close()
        pool.shutdown(wait=False, cancel_futures=True)
    return {each.step.id: each for each in made}


def _discard(lease: Lease) -> None:
    """Delete the drafts of a run, as far as that is possible."""
    with suppress(CacheUnavailable):
        lease.discard_drafts()


def _graph(plan: Plan, context: Context) -> Tasks:
    """Return Dask's tasks by key, and the keys of each step's ``Made`` in the order of the plan.

    The tasks are of Dask's own kind: ``dask.delayed`` goes through all that comes before a task whenever one is added.
    """
    graph: dict[str, Any] = {}
    shared = _add_value(graph, "context", context)
    results: dict[str, Any] = {}
    for planned in plan.steps:
        if planned.state == "hit":
            results[planned.step.id] = _add_value(graph, planned.step.product, _there(planned))
        else:
            results[planned.step.id] = _add_step(graph, planned.step, plan, shared, results)
    return graph, [made.key for made in results.values()]


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


def _add_step(graph: dict[str, Any], step: Step, plan: Plan, shared: Any, results: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Add the tasks of a step, and return what refers to its ``Made``."""
    from dask._task_spec import List

    add = partial(_add_task, graph, step.product)
    inputs = List(*(results[each] for each in dict.fromkeys(each for ids in step.inputs.values() for each in ids)))
    own, forced = _add_value(graph, step.product, step), step.product in plan.forced
    job = add(tasks.begin, shared, own, inputs, forced, step.tiles)
    if step.stage.tile_rows is None or step.size is None:
        parts = [add(tasks.make_whole, shared, job)]
    else:
        ready = add(tasks.create_arrays, job)
        rows = cut_rows(step.size[0], step.stage.tile_rows)
        parts = [add(tasks.make_tile, shared, ready, _add_value(graph, "rows", each)) for each in rows]
    return add(tasks.publish, shared, job, List(*parts))


def totals(made: Iterable[Made]) -> dict[str, tuple[int, int]]:
    """Return by product how many results were there before and how many were made."""
    counts: dict[str, tuple[int, int]] = {}
    for each in made:
        reused, fresh = counts.get(each.step.product, (0, 0))
        counts[each.step.product] = (reused + each.reused, fresh + (not each.reused))
    return counts
