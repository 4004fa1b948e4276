"""Carry out tasks on a Dask cluster, whose workers, scheduler and connections may be lost at any time."""

import logging
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from semidense.cache import CacheUnavailable, Lease, Store
from semidense.pipeline.execution.cluster.deployment import connected, require_able
from semidense.pipeline.execution.graph import Tasks
from semidense.pipeline.execution.jobs import flat
from semidense.pipeline.execution.watch import Watch
from semidense.pipeline.plan.errors import StageFailed, StageRefused, UsageError
from semidense.pipeline.plan.plan import Made

SETTLE_SECONDS = 0.3
"""How long the write may take that a task is in when its run ends early and does not wait for it."""
PATIENCE = 60.0
"""Seconds without any worker after which a run is given up; one that died is started again in a few."""
_PAUSE, _LOOK = 0.02, 1.0
"""Seconds between two looks at what is done, and at who is there."""


def run_on_cluster(
    tasks: Callable[[], Tasks], code: Mapping[str, str], store: Store, lease: Lease, watch: Watch, address: str
) -> list[Made]:
    """Carry out tasks on a cluster and return the results as they came.

    Args:
        tasks: gives the tasks; wanted are the ``Made`` of each step.
        code: hash by name of each module that this needs; the workers must have the same.
        store: the cache, which the workers must see.
        lease: of the run; its drafts are gone at the end, however that comes.
        watch: told about the workers, and of each product that was made.
        address: of the scheduler, see ``deployment.FORMS``.

    Raises:
        UsageError: if the scheduler or all workers are lost, or one task after another kills its worker.
        StageRefused, StageFailed: as a stage does.
    """
    import distributed  # noqa: F401 - which sets up its loggers

    with _quietly(), _explained(address), connected(address) as client:
        watch.deployed(require_able(client, lease, code, str(store.root)))
        _note_tasks(client)
        began = time.time()
        graph, keys = tasks()
        futures = client.get(graph, list(keys), sync=False)
        try:
            made = list(_arriving(client, futures, watch))
        except BaseException:
            _abandon(client, lease)
            raise
        lease.discard_drafts()  # of workers that were killed
        if told := _time_line(client, began):
            watch.deployed(told)
        return made


def _note_tasks(client: Any) -> None:  # noqa: ANN401
    """Have the scheduler note, from now on, which worker is at which task, as its dashboard does."""
    with suppress(Exception):  # a run does not need it
        client.get_task_stream(count=0)


def _time_line(client: Any, began: float) -> str | None:  # noqa: ANN401
    """Return one line about who was at work on what since a run began; None if the scheduler noted nothing."""
    with suppress(Exception):
        return told_time_line(client.get_task_stream(start=began), time.time() - began)
    return None


def told_time_line(tasks: Sequence[Mapping[str, Any]], seconds: float) -> str | None:
    """Return how long a run took, which part of it its workers were at work, and on what longest; None without tasks.

    Args:
        tasks: as Dask's task stream gives them.
        seconds: that the run took.
    """
    spent: Counter[str] = Counter()
    for task in tasks:
        computed = (each["stop"] - each["start"] for each in task["startstops"] if each["action"] == "compute")
        spent[str(task["key"]).partition("-")[0]] += sum(computed)
    threads = len({(task["worker"], task["thread"]) for task in tasks})
    if not threads:
        return None
    longest = ", ".join(f"{product} {most:.1f} s" for product, most in spent.most_common(3))
    part = 100 * spent.total() / threads / seconds
    return f"cluster: done in {seconds:.1f} s; its workers were at work {part:.0f} % of that, longest on {longest}"


@contextmanager
def _quietly() -> Iterator[None]:
    """Keep Dask's own words about lost connections from the terminal: one line of ours says it."""
    handlers = {each for name in ("distributed", "distributed.client") for each in logging.getLogger(name).handlers}
    levels = {each: each.level for each in handlers}  # each of Dask's loggers has a level of its own
    for each in handlers:
        each.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for each, level in levels.items():
            each.setLevel(level)


@contextmanager
def _explained(address: str) -> Iterator[None]:
    """Turn what Dask raises about lost machines into one line."""
    from asyncio import CancelledError
    from concurrent.futures import CancelledError as FutureCancelled

    from distributed import KilledWorker

    try:
        yield
    except (StageFailed, StageRefused, UsageError):
        raise
    except KilledWorker as error:
        raise UsageError(
            f"the workers at {address} died one after another at {error.task}: give them more memory, or look into "
            "their logs; what was made before is kept"
        ) from error
    except (CancelledError, FutureCancelled, OSError) as error:
        raise UsageError(
            f"the Dask scheduler at {address} does not answer any more: start it and run again; what was made before "
            "is kept"
        ) from error


def _arriving(client: Any, futures: Sequence[Any], watch: Watch) -> Iterator[Made]:  # noqa: ANN401
    """Yield results as they come, and see to it that somebody is at work on the rest."""
    from distributed import as_completed

    arriving = as_completed(futures, loop=client.loop)
    workers = _Workers(client)
    while arriving.count():
        for future in arriving.next_batch(block=False):
            for made in flat([future.result()]):
                if not made.reused:
                    watch.published(made)
                yield made
        workers.require()
        time.sleep(_PAUSE)


class _Workers:
    """Looks now and then whether a cluster has workers."""

    def __init__(self, client: Any) -> None:  # noqa: ANN401
        self._client = client
        self._looked = self._there = time.monotonic()

    def require(self) -> None:
        """Refuse to wait on for a cluster that has been without workers for long."""
        now = time.monotonic()
        if now - self._looked < _LOOK:
            return
        self._looked = now
        if self._client.nthreads():
            self._there = now
        elif now - self._there > PATIENCE:
            raise UsageError(
                f"no worker has been there for {PATIENCE:.0f} s: start some and run again; what was made before is kept"
            )


def _abandon(client: Any, lease: Lease) -> None:  # noqa: ANN401
    """Leave the cluster and delete the run's drafts; its workers may live on."""
    with suppress(Exception):
        client.close(timeout=2)  # this releases what is still to be computed
    for _ in range(2):  # a write that is under way brings its folder back, once
        with suppress(CacheUnavailable):
            lease.discard_drafts()
        time.sleep(SETTLE_SECONDS)
