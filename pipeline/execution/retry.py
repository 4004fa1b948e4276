"""Plan and execute, again where an entry that was there went missing or bad meanwhile."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from semidense.cache import DamagedEntry, EntryNotFound, Lease, Store
from semidense.pipeline.execution.scheduler import execute
from semidense.pipeline.execution.watch import Watch
from semidense.pipeline.plan.errors import StageRefused
from semidense.pipeline.plan.plan import Made, Plan

ATTEMPTS = 3
"""How often a run starts, before damage that comes back is told."""


def attempt(
    planned: Callable[[], Plan],
    store: Store,
    watch: Watch,
    extras: Mapping[str, Any],
    scheduler: str | None = None,
    workers: int | None = None,
) -> tuple[Plan, dict[str, Made]]:
    """Carry out a plan, and return it with its results; its entries are kept from cleaning meanwhile.

    An entry that is damaged after it was found is made again like any other: the run plans anew.

    Args:
        planned: makes the plan from the cache as it is.
        store: the cache.
        watch: as for ``execute``.
        extras: as for ``execute``.
        scheduler: as for ``execute``.
        workers: as for ``execute``.

    Raises:
        StageRefused, StageFailed, CacheError: as ``execute`` does.
    """
    plan = planned()
    with store.lease() as lease:
        _keep_sources(plan, store)
        for left in reversed(range(ATTEMPTS)):
            try:
                plan = _kept(plan, planned, store, lease)
                return plan, execute(plan, store, watch, extras, scheduler, workers, lease)
            except (StageRefused, DamagedEntry, EntryNotFound) as error:
                if not left or not isinstance(error.__cause__ or error, (DamagedEntry, EntryNotFound)):
                    raise
                plan = planned()
    raise AssertionError("the last attempt returns or raises")


def _keep_sources(plan: Plan, store: Store) -> None:
    """Keep the texts of the modules that are about to make something: a later run can then say what changed."""
    code: dict[str, str] = {}
    for planned in plan.todo():
        code.update(planned.step.code)
    store.keep_sources(code)


def _kept(plan: Plan, planned: Callable[[], Plan], store: Store, lease: Lease) -> Plan:
    """Keep what a plan uses from being cleaned away; plan again while something was, between plan and now."""
    while True:
        hits: Sequence[str] = [str(each.key) for each in plan.steps if each.state == "hit"]
        lease.add(hits)
        if store.has_all(hits):  # cleaning takes the record away first
            return plan
        plan = planned()
