"""Rows 13 and 16: workers with other code, and workers and schedulers that are killed, on real Dask clusters."""

import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from semidense.cache import Store
from semidense.pipeline import api
from semidense.pipeline.api import Task
from semidense.pipeline.execution.cluster import deployment
from semidense.pipeline.execution.cluster import running as clusters
from semidense.pipeline.execution.retry import attempt
from semidense.pipeline.execution.watch import Unwatched
from semidense.pipeline.plan.errors import UsageError
from tests.faults import world
from tests.faults.runs import slow
from tests.faults.runs.work import SCENES, Scenes, Work, of_scale
from tests.faults.tally import Tally
from tests.tiny import TEST_ONLY

PROJECT = Path(__file__).parents[3]
NAMES = PROJECT / "build" / "names"
EDITS = (
    ("stages/transforms/gray.py", "semidense.stages.transforms.gray"),
    ("pipeline/execution/tiles.py", "semidense.pipeline.execution.tiles"),
    ("datasets/scene.py", "semidense.datasets.scene"),
    ("pipeline/plan/images_and_truth.py", "semidense.pipeline.plan.images_and_truth"),
    ("cache/entries/draft.py", "semidense.cache.entries.draft"),
)
"""Files of which a worker has another version, and their modules."""


def other_code(scale: float) -> Tally:
    """Let a worker have another version of a file than the run's own process."""
    tally = Tally()
    for path, module in EDITS[: max(1, int(len(EDITS) * scale))]:
        with world.folder() as root, _edited_installation(root.parent, path) as names, cluster(0) as address:
            worker = _worker(address, names, root.parent / "log")
            tally.injected += 1
            try:
                api.run(Task(TEST_ONLY, cache=root), "images", scheduler=address)
                tally.fail("wrong", f"{path}: nothing was refused")
            except UsageError as error:
                if f"the module {module} has another text here" not in str(error) or "\n" in str(error):
                    tally.fail("tracebacks", f"{path}: {error}")
            finally:
                worker.kill()
                worker.wait()
            _nothing_left(tally, Store(root), path)
            if published := list(Store(root).entries()):
                tally.fail("wrong", f"{path}: {published[0].label} was published")
    return tally


@contextmanager
def _edited_installation(folder: Path, path: str) -> Iterator[Path]:
    """Copy the packages, and change what one file does."""
    for package in ("pipeline", "stages", "datasets", "cache"):
        shutil.copytree(PROJECT / package, folder / "semidense" / package, ignore=shutil.ignore_patterns("__pycache__"))
    with (folder / "semidense" / path).open("a") as file:
        file.write("\n_EDITED = True\n")
    yield folder


def _worker(address: str, names: Path, log: Path) -> "subprocess.Popen[bytes]":
    command = ["-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(names), str(PROJECT)]),
        "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",  # it keeps workers busy that wait
    }
    with log.open("ab") as file:
        return subprocess.Popen(
            [sys.executable, *command], env=environment, cwd=names, stdout=file, stderr=subprocess.STDOUT
        )


@contextmanager
def cluster(workers: int) -> Iterator[str]:
    """Start a scheduler, with worker processes; another one is started when one dies."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=0, dashboard_address=None, silence_logs=60) as scheduler,
        _kept(scheduler.scheduler_address, workers),
    ):
        if workers:
            with Client(scheduler.scheduler_address, set_as_default=False) as client:
                client.wait_for_workers(workers, timeout=world.HANGS)
        yield scheduler.scheduler_address


@contextmanager
def _kept(address: str, count: int) -> Iterator[None]:
    """Keep so many workers running.

    Dask's own nannies are not used: one whose worker is killed while it starts may not start another.
    """
    with world.folder() as root:
        log, ended = root.parent / "log", threading.Event()

        def keep() -> None:
            running = [_worker(address, NAMES, log) for _ in range(count)]
            while not ended.wait(0.1):
                running = [each if each.poll() is None else _worker(address, NAMES, log) for each in running]
            for each in running:
                each.kill()
                each.wait()

        keeper = threading.Thread(target=keep)
        keeper.start()
        try:
            yield
        finally:
            ended.set()
            keeper.join()


def _nothing_left(tally: Tally, store: Store, where: str) -> None:
    for path in world.leftovers(store):
        tally.fail("leftovers", f"{where}: {path}")


def killed_workers(scale: float) -> Tally:
    """Kill workers of four at random times of a run of eight scenes; then the scheduler, and all workers.

    Its digests are those of a run on threads.
    """
    tally, chance = Tally(), random.Random(16)
    with of_scale(scale) as work, cluster(4) as address:
        kills, at_once = (20, 4) if isinstance(work, Scenes) else (max(2, int(60 * scale)), 1)
        _same_elsewhere(tally, work, address)
        with world.folder() as root:
            expected = work.run(Store(root))
        undisturbed, slowest = [_run(tally, work, address, expected, "no kill") for _ in range(2)][1], 0.0
        for number in range(0, kills, at_once):
            killer = Killer(address, chance, undisturbed, at_once)
            slowest = max(slowest, _run(tally, work, address, expected, f"from kill {number}") / undisturbed)
            killer.join()
        tally.injected += kills
        tally.figures |= {"workers killed": kills, "slowest run in undisturbed ones": round(slowest, 1)}
        tally.figures[work.name] = work.scenes
    _killed_schedulers(tally, max(1, int(3 * scale)))
    _no_workers(tally)
    return tally


def _same_elsewhere(tally: Tally, work: Work, address: str) -> None:
    """Run real scenes with both presets on threads and in processes, with the preset ``paper`` on the cluster too."""
    if not isinstance(work, Scenes):
        return
    for preset, places in (("robust", ("processes:2",)), ("paper", ("processes:2", address))):
        with world.folder() as root:
            expected = replace(work, preset=preset).run(Store(root))
        for place in places:
            _run(tally, replace(work, preset=preset), place, expected, f"{preset} on {place}")


def _run(tally: Tally, work: Work, address: str, expected: dict[str, str], where: str) -> float:
    """Run in a new cache, and look at what is there; return the seconds that the run took."""
    with world.folder() as root:
        store, started = Store(root), time.monotonic()
        try:
            if work.run(store, address) != expected:
                tally.fail("wrong", f"{where}: other digests")
        except Exception as error:  # noqa: BLE001 - whatever it is, the run must not fail
            tally.fail("lost", f"{where}: {error!r}")
        seconds = time.monotonic() - started
        world.judge(tally, store, expected, where)
        _nothing_left(tally, store, where)
    return seconds


class Killer:
    """Kills some of four workers, each at a random time of a run, and waits until the cluster is whole again.

    Args:
        address: of the scheduler.
        chance: chooses.
        seconds: that the run takes.
        count: of the workers to kill.
    """

    def __init__(self, address: str, chance: random.Random, seconds: float, count: int) -> None:
        from distributed import Client

        self._client = Client(address, set_as_default=False)
        self._client.wait_for_workers(4, timeout=world.HANGS)
        pids: dict[str, int] = self._client.run(os.getpid)
        self._pids = chance.sample(sorted(pids.values()), count)
        self._timers = [threading.Timer(chance.uniform(0, seconds), _kill, [pid]) for pid in self._pids]
        for timer in self._timers:
            timer.start()

    def join(self) -> None:
        for timer in self._timers:
            timer.join()
        deadline = time.monotonic() + world.HANGS
        while not self._whole():
            if time.monotonic() > deadline:
                raise RuntimeError(f"four workers were not there {world.HANGS:.0f} s after one was killed")
            time.sleep(0.1)
        self._client.close()

    def _whole(self) -> bool:
        """Say whether there are four workers again, without the killed ones."""
        with suppress(Exception):  # one that was killed may be asked, too
            pids = self._client.run(os.getpid, on_error="ignore")
            return len(pids) == 4 and not {*self._pids} & {*pids.values()}
        return False


def _kill(pid: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def _killed_schedulers(tally: Tally, trials: int) -> None:
    """Kill a scheduler in the middle of a run: one line, and nothing is left."""
    for number in range(trials):
        with world.folder() as root, _outside(root.parent) as (address, scheduler):
            store, graph = Store(root), slow.scenes(SCENES)
            threading.Thread(target=_kill_at_work, args=(store, scheduler, 0.3 * number), daemon=True).start()
            tally.injected += 1
            _refused(tally, store, graph, address, "does not answer", f"scheduler killed, {number}")


def _kill_at_work(store: Store, scheduler: "subprocess.Popen[bytes]", after: float) -> None:
    """Kill the scheduler some time after the first draft was begun."""
    deadline = time.monotonic() + world.HANGS
    while not store.layout.things(store.layout.drafts) and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(after)
    scheduler.kill()


@contextmanager
def _outside(folder: Path) -> Iterator[tuple[str, "subprocess.Popen[bytes]"]]:
    """Start a scheduler and a worker as processes of their own."""
    file = folder / "scheduler.json"
    options = ["--scheduler-file", str(file), "--port", "0", "--no-dashboard"]
    with (folder / "log").open("wb") as log:
        scheduler = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_scheduler", *options], stdout=log, stderr=log, cwd=PROJECT
        )
        address = _address(file)
        worker = _worker(address, NAMES, folder / "worker")
        try:
            yield address, scheduler
        finally:
            for process in (worker, scheduler):
                process.kill()
                process.wait()


def _address(file: Path) -> str:
    import json

    deadline = time.monotonic() + world.HANGS
    while time.monotonic() < deadline:
        with suppress(OSError, ValueError, KeyError):
            return str(json.loads(file.read_text())["address"])
        time.sleep(0.05)
    raise RuntimeError("no scheduler started")


def _refused(tally: Tally, store: Store, graph: Any, address: str, words: str, where: str) -> None:  # noqa: ANN401
    try:
        attempt(lambda: world.plan(store, graph), store, Unwatched(), {}, address)
        tally.fail("lost", f"{where}: the run did not end with an error")
    except UsageError as error:
        if words not in str(error) or "\n" in str(error):
            tally.fail("tracebacks", f"{where}: {error}")
    except Exception as error:  # noqa: BLE001
        tally.fail("tracebacks", f"{where}: {error!r}")
    _nothing_left(tally, store, where)


def _no_workers(tally: Tally) -> None:
    """Run where no worker ever is, and where no scheduler is."""
    patience, answer = clusters.PATIENCE, deployment.ANSWER
    clusters.PATIENCE = 1.5
    try:
        with world.folder() as root, cluster(0) as address:
            tally.injected += 1
            _refused(tally, Store(root), slow.scenes(1), address, "no worker has been there", "no workers")
        deployment.ANSWER = 1.5  # nobody listens at these addresses, however long one waits
        _no_schedulers(tally)
    finally:
        clusters.PATIENCE, deployment.ANSWER = patience, answer


def _no_schedulers(tally: Tally) -> None:
    """Run where nothing answers."""
    for address in ("tcp://127.0.0.1:9", "nonsense://x", "tcp://", "127.0.0.1", "tcp://127.0.0.1:port", ":", "a b"):
        with world.folder() as root:
            tally.injected += 1
            _refused(tally, Store(root), slow.scenes(1), address, "no Dask scheduler answers at", address)
