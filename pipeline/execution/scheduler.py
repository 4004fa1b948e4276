"""Carry out a plan: its steps become Dask tasks, on this machine's threads or on a cluster."""

import os
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext, suppress
from typing import Any

from semidense.cache import CacheUnavailable, Lease, Store
from semidense.pipeline.execution.claims import Claims, LocalClaims
from semidense.pipeline.execution.cluster.deployment import count_threads
from semidense.pipeline.execution.cluster.proof import runner_code
from semidense.pipeline.execution.cluster.running import SETTLE_SECONDS, run_on_cluster
from semidense.pipeline.execution.graph import make_graph, there
from semidense.pipeline.execution.jobs import Context, flat
from semidense.pipeline.execution.watch import Unwatched, Watch
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.plan import Made, Plan


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
        UsageError: if both a scheduler and workers are given.
        StageRefused: if a stage refuses what it was given.
        StageFailed: if a stage fails; what was made before is kept, nothing half-made is left.
    """
    _require_one(scheduler, workers)
    store.sweep_drafts()
    if not plan.todo():
        return {planned.step.id: there(planned) for planned in plan.steps}
    watch.planned(plan, store)
    with nullcontext(lease) if lease else store.lease() as held:
        if scheduler:
            context = Context(store, Unwatched(), extras, Claims(held), runner=runner_code())
            code = {name: each for planned in plan.todo() for name, each in planned.step.code.items()}
            needed = {**code, **(context.runner or {})}
            made = run_on_cluster(lambda: make_graph(plan, context), needed, store, held, watch, scheduler)
        else:
            threads = threads_of(None, workers)
            made = _on_threads(plan, Context(store, watch, extras, LocalClaims(held, store, threads)), threads)
    by_id = {each.step.id: each for each in made}
    return {planned.step.id: by_id[planned.step.id] for planned in plan.steps}


def threads_of(scheduler: str | None, workers: int | None) -> int:
    """Return how many tasks a run carries out at a time, given what ``execute`` is given.

    Raises:
        UsageError: if no scheduler answers, or both are given.
    """
    _require_one(scheduler, workers)
    return count_threads(scheduler) if scheduler else workers or os.cpu_count() or 1


def _require_one(scheduler: str | None, workers: int | None) -> None:
    if scheduler and workers is not None:
        raise UsageError(
            f"--workers {workers} counts threads of this process, and --scheduler {scheduler} works with other ones: "
            f"leave one out; processes:{workers} starts {workers} processes"
        )


def _on_threads(plan: Plan, context: Context, threads: int) -> list[Made]:
    from dask.threaded import get

    (graph, keys), lease = make_graph(plan, context), context.claims.lease
    pool = ThreadPoolExecutor(threads)
    try:
        results: Sequence[Made | Sequence[Made]] = get(graph, keys, pool=pool)
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
    return flat(results)


def _discard(lease: Lease) -> None:
    """Delete the drafts of a run, as far as that is possible."""
    with suppress(CacheUnavailable):
        lease.discard_drafts()


def totals(made: Iterable[Made]) -> dict[str, tuple[int, int]]:
    """Return by product how many results were there before and how many were made."""
    counts: dict[str, tuple[int, int]] = {}
    for each in made:
        reused, fresh = counts.get(each.step.product, (0, 0))
        counts[each.step.product] = (reused + each.reused, fresh + (not each.reused))
    return counts
