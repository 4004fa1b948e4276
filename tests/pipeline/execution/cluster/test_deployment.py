"""Where a run's tasks can be carried out, and what workers are asked before they are given work."""

import json
import re
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from semidense.cache import Store, module_hash
from semidense.cache.processes.lease import FolderLease
from semidense.pipeline.execution.cluster import deployment
from semidense.pipeline.execution.cluster.deployment import Looked, connected, count_threads, require_able
from semidense.pipeline.execution.retry import attempt
from semidense.pipeline.execution.watch import Unwatched
from semidense.pipeline.plan.errors import UsageError
from tests.faults import world
from tests.faults.runs import slow
from tests.pipeline import toy

CODE = {"semidense.cache.owner": str(module_hash("semidense.cache.owner"))}


class Told(Unwatched):
    def __init__(self) -> None:
        self.lines: list[str] = []

    def deployed(self, told: str) -> None:
        self.lines.append(told)


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        yield cluster.scheduler_address


def lease(folder: Path) -> FolderLease:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "lease").touch()
    return FolderLease(folder, folder / "lease")


def test_the_threads_of_workers_are_counted(address: str) -> None:
    assert count_threads(address) == 2
    assert count_threads("processes:3") == 3


def test_workers_that_can_are_told_in_one_line(address: str, tmp_path: Path) -> None:
    with connected(address) as client:
        line = require_able(client, lease(tmp_path), CODE, str(tmp_path))
    assert line.startswith("cluster: 2 workers, at least ")
    assert "\n" not in line


@pytest.mark.parametrize(
    ("code", "seen", "versions", "message"),
    [
        (CODE, False, {}, "does not see the cache at .*: share the folder, or use a cache at a URL"),
        ({"semidense.cache.owner": "0" * 64}, True, {}, "the module semidense.cache.owner has another text here than"),
        ({"no.such.module": "0" * 64}, True, {}, "the module no.such.module is missing here, unlike"),
        (CODE, True, {"dask": "0.1"}, r"has dask 20[0-9.]+, the run 0.1: install the same version everywhere"),
    ],
)
def test_a_worker_that_cannot_do_the_work_is_named_with_the_cause(
    address: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    code: dict[str, str],
    seen: bool,
    versions: dict[str, str],
    message: str,
) -> None:
    real = deployment.version
    monkeypatch.setattr(deployment, "version", lambda name: versions.get(name) or real(name))
    mine = lease(tmp_path)
    if not seen:
        (tmp_path / "lease").unlink()
    with connected(address) as client, pytest.raises(UsageError, match=message) as refused:
        require_able(client, mine, code, str(tmp_path))
    assert "\n" not in str(refused.value)
    assert socket.gethostname() in str(refused.value)


class Answering:
    """A client whose workers answer so."""

    dashboard_link = None

    def __init__(self, **answers: object) -> None:
        self.answers = answers

    def run(self, *_: object, **__: object) -> dict[str, object]:
        return self.answers


def test_a_worker_that_is_killed_while_it_is_asked_ends_no_run(tmp_path: Path) -> None:
    from distributed.comm import CommClosedError

    able, gone = Looked("host", 1, 2 * 10**9, None), CommClosedError("Stream is closed")
    told = require_able(Answering(one=able, other=gone), lease(tmp_path), CODE, str(tmp_path))
    assert told == "cluster: 1 worker, at least 2.0 GB of memory each"
    with pytest.raises(UsageError, match="the worker at other cannot load semidense-stereo: No module"):
        require_able(Answering(one=able, other=ImportError("No module")), lease(tmp_path), CODE, str(tmp_path))


def test_a_scheduler_file_and_the_environment_name_a_scheduler(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import dask

    file = tmp_path / "scheduler.json"
    with connected(address) as client:
        file.write_text(json.dumps(client.scheduler_info()))
    with connected(str(file)) as client:
        assert len(client.nthreads()) == 2
    with dask.config.set({"scheduler-address": address}), connected("env") as client:
        assert len(client.nthreads()) == 2


@pytest.mark.parametrize(
    ("scheduler", "message"),
    [
        ("env", "set DASK_SCHEDULER_ADDRESS"),
        ("nowhere.json", "there is no such file"),
        ("processes:0", "name at least one worker"),
        ("processes:x", r"no Dask scheduler answers at 'processes:x'.*processes:N"),
        ("tcp://127.0.0.1:9", "no Dask scheduler answers at tcp://127.0.0.1:9"),
    ],
)
def test_what_names_no_scheduler_is_refused_in_one_line(
    scheduler: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(deployment, "ANSWER", 2.0)
    with pytest.raises(UsageError, match=message) as refused, connected(scheduler):
        pass
    assert "\n" not in str(refused.value)


@contextmanager
def counted(address: str) -> Iterator[tuple[str, Callable[[], int]]]:
    """Stand between a scheduler and all that connect to it; yield the address, and what tells how many bytes passed."""
    host, port = address.removeprefix("tcp://").split(":")
    total = [0]

    def pump(source: socket.socket, target: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(1 << 16):
                total[0] += len(data)
                target.sendall(data)
        for each in (source, target):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)

    def accept(server: socket.socket) -> None:
        with suppress(OSError):
            while True:
                near, _ = server.accept()
                far = socket.create_connection((host, int(port)))
                for pair in ((near, far), (far, near)):
                    threading.Thread(target=pump, args=pair, daemon=True).start()

    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=accept, args=(server,), daemon=True).start()
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}", lambda: total[0]


def test_keys_travel_and_arrays_do_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrays of ten thousand times the bytes: what passes the scheduler stays the same, heartbeats aside."""
    from distributed import LocalCluster, Worker

    monkeypatch.setattr(slow, "SECONDS", 0.0)
    sent: dict[str, int] = {}
    with (
        LocalCluster(n_workers=0, processes=False, protocol="tcp", dashboard_address=None) as cluster,
        counted(cluster.scheduler_address) as (address, bytes_so_far),
        _worker(cluster, address, Worker),
    ):
        for name, width in (("warm", 4), ("small", 4), ("large", 40_000)):
            monkeypatch.setattr(toy, "WIDTH", width)
            before, told = bytes_so_far(), Told()
            assert _run(Store(tmp_path / name), address, told) > 2 * 10 * width * 4 * 2, "bytes of two volumes a scene"
            sent[name] = bytes_so_far() - before
            assert told.lines[0].startswith("cluster: 1 worker")
            assert re.match(r"cluster: done in .* longest on (ramp|blurred|sum) \d", told.lines[1])
    assert sent["small"] > 0
    assert sent["large"] < 2 * sent["small"] + 100_000


def _run(store: Store, address: str, watch: Told) -> int:
    """Make two scenes on a cluster; return the bytes of their arrays."""
    graph = slow.scenes(2)
    made = attempt(lambda: world.plan(store, graph), store, watch, {}, address)[1]
    return sum(array.nbytes for each in made.values() for array in store.read(each.key).values())


@contextmanager
def _worker(cluster: Any, address: str, kind: Any) -> Iterator[None]:  # noqa: ANN401
    worker = cluster.sync(_start, kind, address)
    try:
        yield
    finally:
        cluster.sync(worker.close)


async def _start(kind: Any, address: str) -> Any:  # noqa: ANN401
    return await kind(address, nthreads=1)
