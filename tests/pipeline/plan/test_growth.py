"""How often records are read does not depend on the number of steps or variants: counted, since seconds are noisy."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from semidense.cache import Store
from semidense.cache.entries import check
from semidense.pipeline.plan.plan import plan_graph
from semidense.pipeline.results.result import Result
from tests.faults import world
from tests.tiny import TRAINED

VARIANTS = range(12)
Reads = Counter[Path]


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> Reads:
    """Count the reads of each record and manifest."""
    counted: Reads = Counter()
    real = check.read_plain
    monkeypatch.setattr(check, "read_plain", lambda path: counted.update([path]) or real(path))
    return counted


@pytest.fixture
def swept(store: Store, reads: Reads) -> Store:
    """A cache of a sweep."""
    world.run(store, world.whole(0, *VARIANTS))
    reads.clear()
    return store


def test_a_plan_of_what_is_cached_reads_each_document_once(swept: Store, reads: Reads) -> None:
    assert plan_graph(world.whole(0, *VARIANTS), swept).todo() == ()
    assert set(reads.values()) == {1}
    assert len(reads) == 2 * len(list(swept.entries())), "a record and a manifest each"


def test_a_plan_of_what_is_to_be_made_reads_each_document_once_more(swept: Store, reads: Reads) -> None:
    planned = plan_graph(world.whole(0, *(100 + each for each in VARIANTS)), swept)
    assert len(planned.todo()) == 2 * len(VARIANTS)
    assert max(reads.values()) == 2, "once for the state of the step, once for what was made earlier"


@pytest.mark.parametrize(
    ("command", "most"),
    [
        pytest.param(["cache", "gc", "--keep", *TRAINED[:1], "--train"], 2, id="gc --keep"),
        pytest.param(["explain", "metrics", *TRAINED, "--scene", "test-0"], 4, id="explain"),
    ],
)
def test_a_command_reads_each_record_a_few_times(
    invoke: Callable[..., Any], trained: Result, reads: Reads, command: list[str], most: int
) -> None:
    """A few: one a purpose, and not one a step or key, of which there are 27."""
    assert invoke(*command, "--cache", trained.store.root).code == 0
    assert len(reads) >= 27
    assert max(reads.values()) <= most
