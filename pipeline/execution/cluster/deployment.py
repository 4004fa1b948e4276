"""Where the tasks of a run are carried out: which Dask scheduler, and whether its workers can do this run's work."""

import re
import socket
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from semidense.cache import Lease
from semidense.pipeline.execution.cluster.proof import require_same_code
from semidense.pipeline.plan.environment import version
from semidense.pipeline.plan.errors import UsageError

SHARED = ("dask", "distributed", "cloudpickle")
"""Packages that must have the same version in the run and in all workers: they encode the tasks."""
FORMS = "tcp://HOST:PORT, processes:N, a scheduler file such as scheduler.json, or env for $DASK_SCHEDULER_ADDRESS"
ANSWER = 10.0
"""Seconds in which a scheduler must answer at first."""
_PROCESSES = re.compile(r"processes:(\d{1,4})", re.ASCII)


@contextmanager
def connected(scheduler: str) -> Iterator[Any]:
    """Connect to a scheduler, or start one with workers of this machine; yield Dask's client of it.

    Args:
        scheduler: one of ``FORMS``.

    Raises:
        UsageError: if it is none of them, or no scheduler answers.
    """
    from distributed import Client

    with ExitStack() as stack:
        where = _where(scheduler, stack)
        try:
            client = Client(**where, timeout=ANSWER, set_as_default=False)
        except Exception as error:  # noqa: BLE001 - Dask raises many kinds, its own assertions among them
            raise UsageError(f"no Dask scheduler answers at {scheduler}: {first_line(error)}") from None
        try:
            yield client
        finally:
            with suppress(Exception):
                client.close(timeout=2)


def count_threads(scheduler: str) -> int:
    """Return how many tasks the workers of a scheduler do at a time, at least 1; no worker is started for it.

    Raises:
        UsageError: as ``connected`` does.
    """
    if match := _PROCESSES.fullmatch(scheduler):
        return max(1, int(match[1]))
    with connected(scheduler) as client:
        return max(1, int(sum(client.nthreads().values())))


def _where(scheduler: str, stack: ExitStack) -> dict[str, str]:
    """Return what tells Dask's client where the scheduler is, after starting one if that is asked for."""
    if match := _PROCESSES.fullmatch(scheduler):
        return {"address": _start(int(match[1]), stack)}
    if scheduler == "env":
        return {"address": _address_of_environment()}
    if scheduler.endswith(".json"):
        if not Path(scheduler).is_file():
            raise UsageError(
                f"--scheduler {scheduler}: there is no such file; `dask scheduler --scheduler-file` writes it"
            )
        return {"scheduler_file": scheduler}
    _require_form(scheduler)
    return {"address": scheduler}


def _start(workers: int, stack: ExitStack) -> str:
    """Start worker processes of one thread each, which end with this run; return the address of their scheduler."""
    if not workers:
        raise UsageError("--scheduler processes:0: name at least one worker, such as processes:4")
    from distributed import LocalCluster

    cluster = LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=60
    )
    stack.callback(cluster.close, timeout=5)
    return str(cluster.scheduler_address)


def _address_of_environment() -> str:
    """Return the scheduler's address that Dask's configuration gives."""
    import dask

    address = dask.config.get("scheduler-address", None)
    if not address:
        raise UsageError("--scheduler env: set DASK_SCHEDULER_ADDRESS, or scheduler-address in Dask's configuration")
    return str(address)


def _require_form(address: str) -> None:
    """Refuse a malformed address here: Dask's client of one takes 20 s to go away."""
    from distributed.comm.addressing import get_address_host_port

    try:
        get_address_host_port(address)
    except ValueError as error:
        raise UsageError(f"no Dask scheduler answers at {address!r}: {first_line(error)}; write {FORMS}") from None


def first_line(error: BaseException) -> str:
    """Return the first line of an error's message, or what kind it is."""
    return str(error).partition("\n")[0] or type(error).__name__


@dataclass(frozen=True)
class Looked:
    """What a worker says before it is given work.

    Attributes:
        host: its machine.
        threads: how many tasks it does at a time.
        memory: its limit in bytes; None without one.
        refusal: why it cannot do this run's work; None if it can.
    """

    host: str
    threads: int
    memory: int | None
    refusal: str | None


def look(
    lease: Lease,
    code: Mapping[str, str],
    versions: Mapping[str, str],
    cache: str,
    dask_worker: Any = None,  # noqa: ANN401
) -> Looked:
    """Return what the worker that this runs in says of itself.

    Args:
        lease: of the run, which a worker sees if it sees the cache.
        code: hash by name of each module that the run needs.
        versions: of the packages that must be the same.
        cache: where it is, for people.
        dask_worker: given by Dask, to an argument of this name.
    """
    refusal = _refusal(lease, code, versions, cache)
    return Looked(socket.gethostname(), dask_worker.state.nthreads, dask_worker.memory_manager.memory_limit, refusal)


def _refusal(lease: Lease, code: Mapping[str, str], versions: Mapping[str, str], cache: str) -> str | None:
    """Return why this process cannot do a run's work; None if it can."""
    host = socket.gethostname()
    for name, expected in versions.items():
        if (found := version(name)) != expected:
            return f"the worker on {host} has {name} {found}, the run {expected}: install the same version everywhere"
    try:
        require_same_code(code)
        if not lease.is_seen():
            return f"the worker on {host} does not see the cache at {cache}: share the folder, or use a cache at a URL"
    except Exception as error:  # noqa: BLE001 - whatever keeps it from looking keeps it from working
        return first_line(error)
    return None


def require_able(client: Any, lease: Lease, code: Mapping[str, str], cache: str) -> str:  # noqa: ANN401
    """Ask all workers for versions, code, memory and the cache; return one line about them.

    Raises:
        UsageError: naming the first worker that cannot do this run's work, and why.
    """
    from distributed.comm import CommClosedError

    versions = {name: version(name) for name in SHARED}
    found = client.run(look, lease, dict(code), versions, cache, on_error="return")
    # A worker that dies while it is asked costs nothing: each task looks at its worker's code again.
    answers = {address: answer for address, answer in found.items() if not isinstance(answer, CommClosedError)}
    for address, answer in sorted(answers.items()):
        if not isinstance(answer, Looked):
            raise UsageError(f"the worker at {address} cannot load semidense-stereo: {first_line(answer)}")
        if answer.refusal:
            raise UsageError(answer.refusal)
    return _told(list(answers.values()), client.dashboard_link)


def _told(workers: list[Looked], dashboard: str | None) -> str:
    """Return how many workers there are, with what memory, and where Dask's dashboard is."""
    limits = [each.memory for each in workers if each.memory]
    memory = f", at least {min(limits) / 1e9:.1f} GB of memory each" if limits else ""
    count = f"{len(workers)} worker{'s' if len(workers) != 1 else ''}" if workers else "no worker yet"
    return f"cluster: {count}{memory}" + (f"; dashboard: {dashboard}" if dashboard else "")
