"""Carry out a plan: its steps become Dask tasks, on this machine's threads or on a cluster."""

import os
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext, suppress
from typing import Any
from uuid import uuid4

from semidense.cache import CacheUnavailable, Lease, Store
from semidense.pipeline.execution import tasks
from semidense.pipeline.execution.claims import Claims, LocalClaims
from semidense.pipeline.execution.cluster import SETTLE_SECONDS, run_on_cluster
from semidense.pipeline.execution.jobs import Context
from semidense.pipeline.execution.proof import runner_code
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
        scheduler: address of a Dask scheduler, ``tcp://...``; None for threads of this process.
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
            return run_on_cluster(lambda: _graph(plan, context), held, watch, scheduler)
        threads = workers or os.cpu_count() or 1
        return _on_threads(plan, Context(store, watch, extras, LocalClaims(held, store, threads)), threads)


def _there(planned: Planned) -> Made:
    return Made(planned.step, str(planned.key), str(planned.digest), planned.seconds or 0.0, reused=True)


def _on_threads(plan: Plan, context: Context, threads: int) -> dict[str, Made]:
    import dask
    from dask.threaded import get

    results, lease = _graph(plan, context), context.claims.lease
    pool = ThreadPoolExecutor(threads)
    try:
        made: Sequence[Made] = dask.compute(*results, scheduler=get, pool=pool)  # by its name, distributed is loaded
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


def _graph(plan: Plan, context: Context) -> list[Any]:
    """Return one delayed ``Made`` a step, in the order of the plan."""
    from dask import delayed

    results: dict[str, Any] = {}
    for planned in plan.steps:
        if planned.state == "hit":
            results[planned.step.id] = delayed(_there(planned), traverse=False)
        else:
            results[planned.step.id] = _delayed_step(planned.step, plan, context, results)
    return list(results.values())


def _delayed_step(step: Step, plan: Plan, context: Context, results: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Return a step's delayed ``Made``."""
    from dask import delayed

    def task(function: Any, *arguments: Any) -> Any:  # noqa: ANN401
        # Dask's profilers and dashboard show the name; it is new each time, for a cluster keeps results by it.
        name = f"{step.product}-{function.__name__}-{uuid4().hex}"
        return delayed(function, pure=False, traverse=False)(*arguments, dask_key_name=name)

    shared = delayed(context, traverse=False)
    inputs = [results[each] for each in dict.fromkeys(each for ids in step.inputs.values() for each in ids)]
    forced = step.product in plan.forced
    job = task(tasks.begin, shared, delayed(step, traverse=False), inputs, forced, tasks.len_tiles(step))
    if step.stage.tile_rows is None or step.size is None:
        parts = [task(tasks.make_whole, shared, job)]
    else:
        ready = task(tasks.create_arrays, job)
        rows = cut_rows(step.size[0], step.stage.tile_rows)
        parts = [task(tasks.make_tile, shared, ready, delayed(each, traverse=False)) for each in rows]
    return task(tasks.publish, shared, job, parts)


def totals(made: Iterable[Made]) -> dict[str, tuple[int, int]]:
    """Return by product how many results were there before and how many were made."""
    counts: dict[str, tuple[int, int]] = {}
    for each in made:
        reused, fresh = counts.get(each.step.product, (0, 0))
        counts[each.step.product] = (reused + each.reused, fresh + (not each.reused))
    return counts
