"""A small world to break: toy stages of every kind, processes that run them, and what must hold afterwards."""

import itertools
import multiprocessing as mp
import os
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from semidense.cache import Store
from semidense.cache.entries import publish
from semidense.cache.upkeep.gc import collect, survey
from semidense.cache.upkeep.limits import Limits
from semidense.cache.upkeep.verify import verify
from semidense.pipeline.execution.retry import attempt
from semidense.pipeline.execution.watch import Unwatched
from semidense.pipeline.plan.errors import USER_ERRORS
from semidense.pipeline.plan.plan import Made, Plan, plan_graph
from semidense.pipeline.plan.steps import Graph
from semidense.stages.catalog import STAGES
from semidense.stages.stage import Output, Stage
from tests.faults.tally import Tally
from tests.pipeline import toy
from tests.tiny import PATH

TRAINED = Stage(
    "trained",
    ("ramp",),
    (Output("sum", ("one",), "float64", "1", "the sum"),),
    "tests.pipeline.toy:train_toy",
    monitored=True,
)
PRELOADED = [
    "tests.faults.world",
    "zarr.codecs",
    "dask.delayed",
    "dask.threaded",
    "distributed",
    "semidense.cache.entries.reader",
    "semidense.pipeline.cli.main",
    "semidense.pipeline.api",
    "torch",
    *sorted({STAGES[product].compute.partition(":")[0] for product in PATH & set(STAGES)}),
]
"""What the server of processes imports once for all of them."""


def whole(start: int = 0, *offsets: int) -> Graph:
    """One product of each kind: read, tiled, from tiles, and monitored; a sweep if there are several offsets."""
    ramp = toy.step(toy.RAMP, start)
    steps = [ramp, toy.step(TRAINED, ramp=ramp)]
    for offset in offsets or (0,):
        blurred = toy.step(toy.BLURRED, toy.Offset(offset=offset, reach=1), ramp=ramp)
        steps += [blurred, toy.step(toy.SUM, offset, blurred=blurred)]
    return Graph({step.id: step for step in steps}, [(step.id, "") for step in steps])


def small(start: int = 0, *offsets: int) -> Graph:
    """The product that is read and those made from it in tiles: the part of ``whole`` that many trials can afford."""
    steps = [step for step in whole(start, *offsets).steps.values() if step.product in ("ramp", "blurred")]
    return Graph({step.id: step for step in steps}, [(step.id, "") for step in steps])


def plan(store: Store, graph: Graph) -> Plan:
    return plan_graph(graph, store)


def run(store: Store, graph: Graph, workers: int = 1) -> dict[str, Made]:
    """Plan and execute a graph as the command line does, in this process."""
    return attempt(lambda: plan(store, graph), store, Unwatched(), {}, workers=workers)[1]


@cache
def truth(start: int = 0, *offsets: int) -> Mapping[str, str]:
    """Return the digests, by key, of an undisturbed run."""
    with folder() as root:
        return {made.key: made.digest for made in run(Store(root), whole(start, *offsets)).values()}


@contextmanager
def folder() -> Iterator[Path]:
    """Make a folder in memory if there is such a place: a trial then costs no disk."""
    memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    with tempfile.TemporaryDirectory(prefix="faults-", dir=memory, ignore_cleanup_errors=True) as name:
        Path(name).chmod(0o755)
        yield Path(name) / "cache"


def sound(store: Store) -> dict[str, int]:
    """Return the keys of the entries that are to the byte what was published, each with its record's inode."""
    return {
        entry.key: store.layout.record(entry.key).stat().st_ino
        for entry in store.entries()
        if store.check(entry.key) is None
    }


def judge(tally: Tally, store: Store, expected: Mapping[str, str], where: str) -> None:
    """Count every readable entry that is not what an undisturbed run makes."""
    for entry in store.entries():
        if store.check(entry.key) is None and expected.get(entry.key) != entry.digest:
            tally.fail("wrong", f"{where}: {entry.label}")


def recover(tally: Tally, store: Store, graph: Graph, expected: Mapping[str, str], where: str) -> None:
    """Run again undisturbed: all digests equal, what was sound is reused, nothing is left over."""
    before = sound(store)
    judge(tally, store, expected, where)
    try:
        made = run(store, graph)
    except Exception as error:  # noqa: BLE001 - whatever it is, the rerun must not fail
        tally.fail("tracebacks" if not isinstance(error, USER_ERRORS) else "lost", f"{where}: rerun: {error!r}")
        return
    for each in made.values():
        if expected[each.key] != each.digest:
            tally.fail("wrong", f"{where}: rerun: {each.step.name}")
        if each.key in before and not each.reused:
            tally.fail("lost", f"{where}: {each.step.name} was sound and made again")
    after = sound(store)
    for key, inode in before.items():
        if after.get(key) != inode:
            tally.fail("lost", f"{where}: entry {key[:12]} was replaced")
    judge(tally, store, expected, where)
    for path in leftovers(store):
        tally.fail("leftovers", f"{where}: {path}")


def leftovers(store: Store) -> list[str]:
    """Return what crashes left and the next run should have taken away."""
    layout = store.layout
    folders = (layout.drafts, layout.locks, layout.leases, layout.checkpoints)
    return [f"{each.name}/{path.name}" for each in folders if each.is_dir() for path in each.iterdir()]


# What runs in processes of its own: a server is forked while it has no threads, so that its children may fork safely.

Job = Callable[..., None]
HANGS = 900.0
"""Seconds after which a process is taken to hang: many times what it takes on a machine that is busy otherwise."""


@cache
def context() -> Any:  # noqa: ANN401
    found = mp.get_context("forkserver")
    found.set_forkserver_preload(PRELOADED)
    return found


def start(job: Job, *arguments: object, **options: object) -> Any:  # noqa: ANN401
    """Start a job; it must be a function of a module."""
    process = context().Process(target=job, args=arguments, kwargs=options, daemon=True)
    process.start()
    return process


def finish(process: Any, seconds: float = HANGS) -> int | None:  # noqa: ANN401
    """Return a process's exit code; None if it hangs, and is then killed."""
    process.join(seconds)
    if process.exitcode is None:
        process.kill()
        process.join()
        return None
    return int(process.exitcode)


def in_child(job: Job, *arguments: object, **options: object) -> int | None:
    return finish(start(job, *arguments, **options))


def quiet(log: Path) -> None:
    """Let what a child says go to a file."""
    handle = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
    os.dup2(handle, 1)
    os.dup2(handle, 2)
    sys.stdout = sys.stderr = os.fdopen(handle, "w")


USER_ERROR, OTHER_ERROR = 2, 1


def job_run(
    root: Path,
    log: Path,
    graph: tuple[int, ...] = (0,),
    *,
    make: Callable[..., Graph] = whole,
    die_at: int | None = None,
    raise_at: int | None = None,
    pause: float = 0.0,
    workers: int = 1,
    user: int | None = None,
    largest_file: int | None = None,
) -> None:
    """Run a graph; die, fail or dawdle at the steps of the protocol; exit as the command line would."""
    quiet(log)
    count, lock = itertools.count(), threading.Lock()

    def hook(step: str) -> None:
        with lock:
            number = next(count)
        if number == die_at:
            os.kill(os.getpid(), signal.SIGKILL)
        if number == raise_at:
            raise OSError(28, "No space left on device")
        time.sleep(pause)

    def seen(name: str, real: Callable[[str], None] = toy.seen) -> None:
        real(name)
        with log.with_suffix(".made").open("a") as file:
            file.write(f"{name}\n")

    toy.seen = seen
    publish.STEP_HOOK = hook
    _restrict(user, largest_file)
    _exit_as_the_command_line(lambda: run(Store(root), make(*graph), workers))


def _restrict(user: int | None, largest_file: int | None) -> None:
    if largest_file is not None:
        import resource

        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, resource.RLIM_INFINITY))
    if user is not None and os.getuid() == 0:
        os.setgid(user)
        os.setuid(user)


def _exit_as_the_command_line(work: Callable[[], object]) -> None:
    try:
        work()
    except USER_ERRORS as error:
        with suppress(OSError):  # a file may be too large for what the child may write
            sys.stderr.write(f"{type(error).__name__}: {error}")
            sys.stderr.flush()
        os._exit(OTHER_ERROR if "\n" in str(error) else USER_ERROR)
    except BaseException:  # noqa: BLE001
        import traceback

        traceback.print_exc()
        sys.stderr.flush()
        os._exit(OTHER_ERROR)
    os._exit(0)


def job_gc(root: Path, log: Path, seconds: float | None) -> None:
    """Delete all that may go; entries too, if they are unused for so many seconds."""
    quiet(log)
    store = Store(root)
    _exit_as_the_command_line(lambda: collect(store, survey(store, Limits(seconds=seconds)).items))


def job_verify(root: Path, log: Path) -> None:
    """Verify; damage is an error here, since nobody damages anything."""
    quiet(log)

    def work() -> None:
        if damaged := verify(Store(root)).damaged:
            raise RuntimeError(f"damaged: {damaged}")

    _exit_as_the_command_line(work)


def count_steps(graph: tuple[int, ...] = (0,)) -> int:
    """Return how many steps of the protocol an undisturbed run of one thread takes."""
    numbers: list[str] = []
    real = publish.STEP_HOOK
    try:
        publish.STEP_HOOK = numbers.append  # type: ignore[assignment]
        with folder() as root:
            run(Store(root), whole(*graph))
    finally:
        publish.STEP_HOOK = real
    return len(numbers)


def said(log: Path, longest: int = 400) -> str:
    """Return the end of what a child said."""
    return log.read_text(errors="replace")[-longest:] if log.exists() else ""
