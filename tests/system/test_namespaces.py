"""A worker in a network namespace of its own: a machine beside this one, as far as the network is concerned."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from semidense.cache import Store
from semidense.pipeline.execution.retry import attempt
from semidense.pipeline.execution.watch import Unwatched
from tests.faults import world
from tests.faults.runs import slow

PROJECT = Path(__file__).parents[2]
HERE, THERE = "10.251.77.1", "10.251.77.2"


def ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True)


@pytest.fixture
def namespace() -> Iterator[str]:
    """The name of a network namespace that reaches this one at ``HERE``."""
    name = f"sd{os.getpid()}"
    try:
        ip("netns", "add", name)
        ip("link", "add", name, "type", "veth", "peer", "name", "far", "netns", name)
        ip("addr", "add", f"{HERE}/30", "dev", name)
        ip("link", "set", name, "up")
        ip("-n", name, "addr", "add", f"{THERE}/30", "dev", "far")
        ip("-n", name, "link", "set", "far", "up")
    except (OSError, subprocess.CalledProcessError) as error:
        _remove(name)
        pytest.skip(f"this machine makes no network namespaces: {error}")
    yield name
    _remove(name)


def _remove(namespace: str) -> None:
    """Remove a namespace, if it is there, and with it the link into it."""
    with suppress(OSError, subprocess.CalledProcessError):
        ip("netns", "del", namespace)


@contextmanager
def worker(namespace: str, address: str) -> Iterator[None]:
    """Start a worker in a namespace."""
    options = ["--nthreads", "1", "--no-nanny", "--no-dashboard"]
    command = ["ip", "netns", "exec", namespace, sys.executable, "-m", "distributed.cli.dask_worker", address, *options]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(PROJECT / "build" / "names"), str(PROJECT)])}
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.kill()
        process.wait()


def test_a_worker_in_another_network_makes_the_same_digests(
    namespace: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from distributed import LocalCluster

    monkeypatch.setattr(slow, "SECONDS", 0.0)
    graph = slow.scenes(1)
    expected = world.run(Store(tmp_path / "here"), graph)
    store = Store(tmp_path / "there")
    with (
        LocalCluster(n_workers=0, host=HERE, protocol="tcp", dashboard_address=None) as cluster,
        worker(namespace, cluster.scheduler_address),
    ):
        made = attempt(lambda: world.plan(store, graph), store, Unwatched(), {}, cluster.scheduler_address)[1]
        (name,) = cluster.scheduler.workers
        assert name.startswith(f"tcp://{THERE}:")
    assert {each.key: each.digest for each in made.values()} == {each.key: each.digest for each in expected.values()}
