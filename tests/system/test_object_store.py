"""Runs over a real S3 server on loopback: the digests are those on disk, by threads and processes, also with faults."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from semidense.cache import Store
from semidense.cache.upkeep.verify import size, verify
from semidense.pipeline import api
from semidense.pipeline.api import Task
from semidense.pipeline.execution.retry import attempt
from semidense.pipeline.execution.watch import Unwatched
from semidense.pipeline.results.result import Result
from tests.faults import world
from tests.faults.runs import slow
from tests.faults.runs.workers import cluster
from tests.s3 import Faults, pointed_at, proxy, s3_server
from tests.tiny import TEST_ONLY

INJECTED = 200
SCENES = 8


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with s3_server(page=1000) as found:  # a list of many pages begins anew when one of them goes wrong
        yield found


@pytest.fixture(autouse=True)
def own_near(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIPELINE_NEAR", str(tmp_path / "near"))


def require_same(result: Result, expected: Result) -> None:
    for step_id, made in result.made.items():
        assert (made.key, made.digest) == (expected.made[step_id].key, expected.made[step_id].digest)


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("scheduler", [None, "processes:2"])
def test_s3_holds_the_same_keys_and_digests_as_a_folder(
    port: int, trained: Result, trained_task: Task, scheduler: str | None
) -> None:
    with pointed_at(port) as url:
        result = api.run(replace(trained_task, cache=url), "disparity", scheduler=scheduler)
        require_same(result, trained)
        store = Store(url)
        assert (verify(store).damaged, size(store).drafts, size(store).orphans) == ({}, 0, 0)
        again = api.run(replace(trained_task, cache=url), "disparity")
        assert all(made.reused for made in again.made.values())


@pytest.fixture(scope="module")
def four_workers(port: int) -> Iterator[str]:
    """The address of a cluster of four processes that find the S3 server."""
    with pointed_at(port), cluster(4) as address:
        yield address


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("preset", ["paper", "robust"])
def test_four_workers_give_the_digests_of_threads_in_a_folder_and_on_s3(
    port: int, four_workers: str, tmp_path: Path, preset: str
) -> None:
    task = Task(TEST_ONLY, preset=preset)
    expected = api.run(task, cache=tmp_path / "threads")
    require_same(api.run(task, cache=tmp_path / "workers", scheduler=four_workers), expected)
    require_same(api.run(task, cache="memory://" + preset), expected)
    with pointed_at(port) as url:
        require_same(api.run(task, cache=url, scheduler=four_workers), expected)
    with pointed_at(port) as url:
        require_same(api.run(task, cache=url), expected)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_requests_that_go_wrong_cost_time_and_nothing_else(port: int, tmp_path: Path) -> None:
    graph, folder = slow.scenes(SCENES), Store(tmp_path / "cache")
    expected = attempt(lambda: world.plan(folder, graph), folder, Unwatched(), {})[1]
    faults = Faults(rate=0.25, slow=0.2)
    while faults.injected.total() < INJECTED:
        with proxy(port, faults) as before, pointed_at(before) as url:
            store = Store(url)
            made = attempt(lambda s=store: world.plan(s, graph), store, Unwatched(), {})[1]  # type: ignore[misc]
            assert {each.key: each.digest for each in made.values()} == {
                each.key: each.digest for each in expected.values()
            }
            report, sizes = verify(store), size(store)
            assert (len(report.sound), report.damaged, report.quarantined) == (len(made), {}, {})
            assert (sizes.drafts, sizes.orphans) == (0, 0)
    assert set(faults.injected) == set(faults.kinds)
