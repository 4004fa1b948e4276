"""Carry out a plan: its steps become Dask tasks, on this machine's threads or on a cluster."""

import os
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any
from uuid import uuid4

from semidense.cache import Draft, Lease, Store
from semidense.pipeline.execution import tasks
from semidense.pipeline.execution.claims import Claims, LocalClaims
from semidense.pipeline.execution.tasks import Context
from semidense.pipeline.execution.tiles import cut_rows
from semidense.pipeline.execution.watch import Unwatched, Watch
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.plan import Made, Plan, Planned
from semidense.pipeline.plan.steps import Step

SETTLE_SECONDS = 0.3
"""How long the write may take that a task is in when its run ends early and does not wait for it."""


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
    lease = lease or Lease(store.root, None)
    if scheduler:
        return _on_cluster(plan, Context(store, Unwatched(), extras, Claims(lease)), watch, scheduler)
    threads = workers or os.cpu_count() or 1
    return _on_threads(plan, Context(store, watch, extras, LocalClaims(lease, store, threads)), threads)


def _there(planned: Planned) -> Made:
    return Made(planned.step, str(planned.key), str(planned.digest), planned.seconds or 0.0, reused=True)


def _on_threads(plan: Plan, context: Context, threads: int) -> dict[str, Made]:
    import dask
    from dask.threaded import get

    drafts = _Drafts(context.watch)
    results, _ = _graph(plan, replace(context, watch=drafts))
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
        drafts.discard()
        time.sleep(SETTLE_SECONDS)
        raise
    finally:
        context.claims.stop()
        drafts.discard()
        context.claims.close()
        pool.shutdown(wait=False, cancel_futures=True)
    return {each.step.id: each for each in made}


def _on_cluster(plan: Plan, context: Context, watch: Watch, address: str) -> dict[str, Made]:
    from distributed import Client, as_completed

    try:
        client = Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise UsageError(f"no Dask scheduler answers at {address}: {error}") from None
    results, jobs = _graph(plan, context)
    with client:
        futures = client.compute([*results, *jobs])
        begun = futures[len(results) :]
        made = {}
        try:
            for future in as_completed(futures[: len(results)], loop=client.loop):
                each: Made = future.result()
                made[each.step.id] = each
                if not each.reused:
                    watch.published(each)
        except BaseException:
            _abandon(client, begun)
            raise
    return {planned.step.id: made[planned.step.id] for planned in plan.steps}


def _abandon(client: Any, begun: Iterable[Any]) -> None:  # noqa: ANN401 - Dask's types carry no annotations
    """Leave the cluster and delete the drafts of a run that ends early: the workers, who own them, may live on."""
    drafts = [future.result().draft for future in begun if future.status == "finished"]
    client.close()  # this releases what is still to be computed
    for _ in range(2):  # a write that is under way brings its folder back, once
        for draft in drafts:
            if draft is not None:
                draft.discard()
        time.sleep(SETTLE_SECONDS)


def _graph(plan: Plan, context: Context) -> tuple[list[Any], list[Any]]:
    """Return one delayed ``Made`` a step, and one delayed ``Job`` a step that is not a hit."""
    from dask import delayed

    results: dict[str, Any] = {}
    jobs = []
    for planned in plan.steps:
        if planned.state == "hit":
            results[planned.step.id] = delayed(_there(planned), traverse=False)
        else:
            results[planned.step.id], job = _delayed_step(planned.step, plan, context, results)
            jobs.append(job)
    return list(results.values()), jobs


def _delayed_step(step: Step, plan: Plan, context: Context, results: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return a step's delayed ``Made``, and the delayed ``Job`` that it starts with."""
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
    return task(tasks.publish, shared, job, parts), job


class _Drafts:
    """A watch that also remembers which drafts are open, to delete them when the run ends early."""

    def __init__(self, watch: Watch) -> None:
        self._watch = watch
        self._open: dict[str, Draft] = {}

    def begun(self, step: Step, draft: Draft, tiles: int) -> None:
        self._open[step.id] = draft
        self._watch.begun(step, draft, tiles)

    def waiting(self, step: Step, holder: str) -> None:
        self._watch.waiting(step, holder)

    def advanced(self, step: Step, done: int, total: int, note: str) -> None:
        self._watch.advanced(step, done, total, note)

    def published(self, made: Made) -> None:
        self._open.pop(made.step.id, None)
        self._watch.published(made)

    def discard(self) -> None:
        """Delete the drafts that were not published."""
        for draft in list(self._open.values()):
            draft.discard()


def totals(made: Iterable[Made]) -> dict[str, tuple[int, int]]:
    """Return by product how many results were there before and how many were made."""
    counts: dict[str, tuple[int, int]] = {}
    for each in made:
        reused, fresh = counts.get(each.step.product, (0, 0))
        counts[each.step.product] = (reused + each.reused, fresh + (not each.reused))
    return counts
