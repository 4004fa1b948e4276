"""The same plan on a Dask cluster of two processes that share the cache's folder."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semidense.cache import Store, code_parts
from semidense.pipeline import api
from semidense.pipeline.api import Task
from semidense.pipeline.execution.graph import MANY, batches
from semidense.pipeline.execution.scheduler import execute
from semidense.pipeline.execution.watch import Unwatched
from semidense.pipeline.plan.errors import StageFailed, StageRefused
from semidense.pipeline.plan.plan import Made, Plan
from semidense.pipeline.plan.steps import Graph, Step
from semidense.pipeline.results.opening import open_product
from semidense.pipeline.results.result import Result
from tests.pipeline.toy import BLURRED, RAMP, SUM, Offset, chain, graph, step
from tests.tiny import TRAINED


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """The address of a scheduler with two worker processes."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        yield cluster.scheduler_address


class Seen(Unwatched):
    def __init__(self) -> None:
        self.made: list[Made] = []

    def published(self, made: Made) -> None:
        self.made.append(made)


def test_a_cluster_makes_the_same_keys_and_digests_as_threads(
    scheduler: str, trained: Result, trained_task: Task, tmp_path: Path
) -> None:
    seen = Seen()
    task = replace(trained_task, cache=tmp_path / "shared")
    result = api.run(task, "disparity", scheduler=scheduler, watch=seen)
    assert result.made.keys() <= trained.made.keys()
    for step_id, made in result.made.items():
        assert (made.key, made.digest) == (trained.made[step_id].key, trained.made[step_id].digest)
    assert len(seen.made) == len(result.made)
    assert [planned.step.id for planned in result.plan.steps] == list(result.made), "in the order of the plan"
    assert list((tmp_path / "shared" / "drafts").iterdir()) == []


def test_the_command_line_finds_the_scheduler(scheduler: str, invoke: Callable[..., Any], own_cache: Path) -> None:
    ran = invoke("run", *TRAINED, "--cache", own_cache, "--scheduler", scheduler, "--set", "semidense.R=0")
    assert ran.code == 0, ran.err
    assert ran.out.splitlines()[-1] == "reused 25 products, made 1 semidense, 1 metrics"


def planned(graph: Graph, store: Store, monkeypatch: pytest.MonkeyPatch) -> Plan:
    from semidense.pipeline.plan import plan as planning

    code = code_parts("tests.pipeline.toy", ("tests",))
    proven = Graph({each.id: replace(each, code=code) for each in graph.steps.values()}, graph.targets)
    monkeypatch.setattr(planning, "build", lambda _: proven)
    request: Any = None
    return planning.make_plan(request, store)


def run(graph: Graph, store: Store, scheduler: str, monkeypatch: pytest.MonkeyPatch) -> dict[str, Made]:
    return execute(planned(graph, store, monkeypatch), store, Unwatched(), {}, scheduler)


def test_a_worker_that_is_killed_in_a_batch_costs_the_scene_that_it_was_at(
    scheduler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = [tmp_path / str(number) for number in range(MANY)]
    noted = replace(RAMP, compute="tests.pipeline.toy:note_and_ramp")
    deadly = replace(SUM, compute="tests.pipeline.toy:die_once")
    steps: list[Step] = []
    for number, folder in enumerate(calls):
        folder.mkdir()
        ramp = step(noted, str(folder), scene=f"Toy {number}")
        blurred = step(BLURRED, Offset(reach=1, offset=number), scene=ramp.scene, ramp=ramp)
        last = step(deadly if number == 3 else SUM, str(tmp_path / "killed"), scene=ramp.scene, blurred=blurred)
        steps += [ramp, blurred, last]
    store, many = Store(tmp_path / "shared"), graph(*steps)
    plan = planned(many, store, monkeypatch)
    assert [len(each) for each in batches(plan.todo())] == [3] * MANY
    made = execute(plan, store, Unwatched(), {}, scheduler)
    assert (tmp_path / "killed").exists()
    assert [len(list(folder.iterdir())) for folder in calls] == [1, 1, 1, 2, *[1] * (MANY - 4)]
    assert list(store.layout.drafts.iterdir()) == []
    on_threads = execute(plan, Store(tmp_path / "threads"), Unwatched(), {})
    assert [each.digest for each in made.values()] == [each.digest for each in on_threads.values()]


@pytest.mark.parametrize(
    ("function", "kind", "message"),
    [
        ("fail_below", StageFailed, r"blurred of Toy, rows \d-\d: RuntimeError: the fourth row broke it"),
        ("refuse", StageRefused, r"blurred of Toy, rows \d-\d: these values are no good"),
    ],
)
def test_a_stage_that_fails_on_a_cluster_is_named_and_leaves_nothing(
    scheduler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, function: str, kind: type[Exception], message: str
) -> None:
    store = Store(tmp_path / "shared")
    with pytest.raises(kind, match=message):
        run(chain(stage=replace(BLURRED, compute=f"tests.pipeline.toy:{function}")), store, scheduler, monkeypatch)
    assert list(store.layout.drafts.iterdir()) == []
    assert [entry.label["product"] for entry in store.entries()] == ["ramp"]
    made = run(chain(), store, scheduler, monkeypatch)
    assert [each.reused for each in made.values()] == [True, False, False]
    assert computed_here(store, made).sum() > 0, "the cluster is not what other work is sent to"


def computed_here(store: Store, made: dict[str, Made]) -> np.ndarray:
    """Compute something with Dask after a run on a cluster."""
    (key,) = (each.key for each in made.values() if each.step.product == "blurred")
    return open_product(store, key)["values"].values
