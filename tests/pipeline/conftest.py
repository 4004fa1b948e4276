from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from semidense.cache import Store
from semidense.pipeline.execution.scheduler import execute
from semidense.pipeline.execution.watch import Unwatched
from semidense.pipeline.plan import plan as planning
from semidense.pipeline.plan.plan import Made, Plan, make_plan
from semidense.pipeline.plan.steps import Graph
from tests.pipeline import toy


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "cache")


@pytest.fixture(autouse=True)
def no_calls() -> Iterator[None]:
    """Forget which toy functions ran before."""
    toy.CALLS.clear()
    yield
    toy.CALLS.clear()


@pytest.fixture
def toy_plan(store: Store, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Plan]:
    """Plan a graph of toy steps."""

    def plan(graph: Graph, *forced: str) -> Plan:
        monkeypatch.setattr(planning, "build", lambda _: graph)
        monkeypatch.setattr(planning, "products", lambda: ("ramp", "blurred", "clipped", "sum"))
        request: Any = None
        return make_plan(request, store, forced)

    return plan


@pytest.fixture
def toy_run(toy_plan: Callable[..., Plan], store: Store) -> Callable[..., dict[str, Made]]:
    """Plan and execute a graph of toy steps; return the results by product."""

    def run(graph: Graph, *forced: str, workers: int = 2) -> dict[str, Made]:
        made = execute(toy_plan(graph, *forced), store, Unwatched(), {}, workers=workers)
        return {each.step.product: each for each in made.values()}

    return run


@pytest.fixture
def drafts(store: Store) -> Callable[[], list[str]]:
    """Name the drafts that are there."""
    return lambda: sorted(path.name for path in store.layout.drafts.iterdir()) if store.layout.drafts.is_dir() else []
