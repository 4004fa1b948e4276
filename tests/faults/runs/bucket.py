"""A cache in an object store to break, on a real S3 server: processes that use it, and what must hold afterwards."""

import itertools
import os
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from semidense.cache import Store
from semidense.cache.objects import names, records
from semidense.cache.objects.living import EXPIRY
from semidense.cache.objects.requests import Objects, connect
from semidense.cache.upkeep import objects_gc
from semidense.cache.upkeep.gc import collect, survey
from semidense.cache.upkeep.limits import Limits
from semidense.cache.upkeep.verify import verify
from tests.faults import world
from tests.faults.tally import Tally
from tests.s3 import fresh_url, pointed_at, s3_server

TRANSIENT = ("drafts", "claims", "checkpoints", "cleaning", "probe")
"""What is there only while somebody is at work."""
HANDED_ON = ("AWS_", "PIPELINE_")
"""Environment variables by which child processes find the server: theirs is that of a server of processes."""


@contextmanager
def nothing_kept() -> Iterator[None]:
    """Have this machine keep nothing of what it reads: all comes from the store."""
    before = dict(os.environ)
    with world.folder() as folder:
        os.environ.update({"PIPELINE_NEAR": str(folder), "PIPELINE_NEAR_BYTES": "0"})
        try:
            yield
        finally:
            os.environ.clear()
            os.environ.update(before)


@contextmanager
def opened() -> Iterator[int]:
    """Start a server and have this process use it; yield its port."""
    with nothing_kept(), s3_server(page=1000) as port, pointed_at(port):
        yield port


def environment() -> dict[str, str]:
    """Return what child processes need to find the server."""
    return {name: value for name, value in os.environ.items() if name.startswith(HANDED_ON)}


def job_run(
    url: str, variables: Mapping[str, str], log: Path, graph: tuple[int, ...] = (0,), die_at: int | None = None
) -> None:
    """Run a graph and exit as the command line would; die before or after one of the requests that change something."""
    world.quiet(log)
    os.environ.update(variables)
    numbers = itertools.count()

    def step() -> None:
        if next(numbers) == die_at:
            os.kill(os.getpid(), signal.SIGKILL)

    told_of_changes(step)
    world._exit_as_the_command_line(lambda: world.run(Store(url), world.whole(*graph)))


def job_clean(url: str, variables: Mapping[str, str], log: Path, times: int) -> None:
    """Delete all that may go, entries too."""
    world.quiet(log)
    os.environ.update(variables)

    def work() -> None:
        for _ in range(times):
            collect(Store(url), survey(Store(url), Limits(seconds=0.0)).items)

    world._exit_as_the_command_line(work)


def job_verify(url: str, variables: Mapping[str, str], log: Path, times: int) -> None:
    """Verify; damage is an error here, since nobody damages anything."""
    world.quiet(log)
    os.environ.update(variables)

    def work() -> None:
        for _ in range(times):
            if damaged := verify(Store(url)).damaged:
                raise RuntimeError(f"damaged: {damaged}")

    world._exit_as_the_command_line(work)


def told_of_changes(step: Callable[[], None]) -> Callable[[], None]:
    """Call a function before and after each request that changes something; return what ends this."""
    real = {name: getattr(Objects, name) for name in ("_put", "delete")}

    def between(request: Callable[..., None]) -> Callable[..., None]:
        def told(*arguments: Any, **options: Any) -> None:  # noqa: ANN401
            step()
            request(*arguments, **options)
            step()

        return told

    for name, request in real.items():
        setattr(Objects, name, between(request))
    return lambda: [setattr(Objects, name, request) for name, request in real.items()] and None


def count_steps() -> int:
    """Return how many times a run of one thread can be killed: before and after each request that changes something."""
    steps: list[int] = []
    undo = told_of_changes(lambda: steps.append(1))
    try:
        world.run(Store(fresh_url()), world.whole())
    finally:
        undo()
    return len(steps)


def sound(store: Store) -> dict[str, tuple[str, Mapping[str, str]]]:
    """Return the keys of the entries that are to the byte what was published: the digest, and the record's version."""
    found = {key: connect(str(store.root)).get(names.record(key)) for key in verify(store).sound}
    return {key: (records.parse(key, each.data).entry.digest, each.version) for key, each in found.items() if each}


def judged(tally: Tally, store: Store, expected: Mapping[str, str], where: str) -> dict[str, Mapping[str, str]]:
    """Count every entry that can be read and is not what an undisturbed run makes; return the versions of all."""
    found = sound(store)
    for key, (digest, _) in found.items():
        if expected.get(key) != digest:
            tally.fail("wrong", f"{where}: {key}")
    return {key: version for key, (_, version) in found.items()}


def recover(tally: Tally, store: Store, expected: Mapping[str, str], where: str, *graph: int) -> None:
    """Run again undisturbed: all digests equal, what was sound is reused, and a cleaning leaves nothing over."""
    before = judged(tally, store, expected, where)
    try:
        with later(EXPIRY + 1):  # else it waits so long for the claims of who was killed
            made = world.run(store, world.whole(*(graph or (0,))))
    except Exception as error:  # noqa: BLE001 - whatever it is, the rerun must not fail
        tally.fail("lost" if isinstance(error, world.USER_ERRORS) else "tracebacks", f"{where}: rerun: {error!r}")
        return
    for each in made.values():
        if expected[each.key] != each.digest:
            tally.fail("wrong", f"{where}: rerun: {each.step.name}")
    clean_later(store)
    after = judged(tally, store, expected, where)
    for key, version in before.items():
        if after.get(key) != version:
            tally.fail("lost", f"{where}: entry {key[:12]} was replaced")
    for path in leftovers(store):
        tally.fail("leftovers", f"{where}: {path}")


@contextmanager
def later(seconds: float) -> Iterator[None]:
    """Let the store's clock be further on, as this process sees it."""
    real = Objects.now
    Objects.now = lambda self: real(self) + seconds  # type: ignore[method-assign]
    try:
        yield
    finally:
        Objects.now = real  # type: ignore[method-assign]


def clean_later(store: Store) -> None:
    """Clean as if all who work now had been dead for more than a day; entries stay."""
    with later(objects_gc.ORPHAN_SECONDS + EXPIRY):
        while items := survey(store, Limits()).items:  # what stands in place of a draft's manifest comes second
            collect(store, items)


def leftovers(store: Store) -> list[str]:
    """Return the objects that belong to no entry and to nobody alive."""
    objects = connect(str(store.root))
    keys = {entry.key: records.read(objects, entry.key).place for entry in store.entries()}
    referred = {f"data/{place}" for place in keys.values()}
    everything = [each.path for each in objects.below("")]
    return [
        path
        for path in everything
        if path.split("/")[0] in TRANSIENT
        or path.endswith("/alive")
        or (path.startswith("data/") and "/".join(path.split("/")[:3]) not in referred)
    ]
