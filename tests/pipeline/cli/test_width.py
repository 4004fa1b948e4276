"""What a terminal of 80 columns shows."""

import io

import pytest
from rich.console import Console

from semidense.cache import Store
from semidense.pipeline.api import Task, explain
from semidense.pipeline.cli import console as printing
from semidense.pipeline.cli.commands import inspect
from semidense.pipeline.cli.commands.cache import listing
from semidense.pipeline.results.result import Result


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    """A terminal of 80 columns that all tables are printed on."""
    text = io.StringIO()
    narrow = Console(file=text, width=80, highlight=False)
    for module in (printing, listing):
        monkeypatch.setattr(module, "results", lambda: narrow)
    monkeypatch.setattr(inspect, "Console", lambda **_: narrow)
    return text


def test_metrics(trained: Result, terminal: io.StringIO) -> None:
    printing.print_metrics(trained.metrics, trained.mask_kinds())
    shown = terminal.getvalue()
    assert "…" not in shown
    for row in trained.metrics:
        if row["mask"] == "nonocc":
            assert all(f"{row[name]:.2f}" in shown for name in ("bad", "invalid") if name in row)


def test_cache_ls(trained: Result, terminal: io.StringIO) -> None:
    listing.list_entries(trained.store.root, listing.Selection(), False)
    shown = terminal.getvalue()
    assert "…" not in shown
    store = Store(trained.store.root)
    assert all(entry.key[:12] in shown for entry in store.entries())


def test_inspect(trained: Result, trained_task: Task, terminal: io.StringIO) -> None:
    found = inspect.inspection(explain(trained_task, "costvolume"), trained.store, trained_task)
    inspect.print_inspection(found, None, False)
    assert "…" not in terminal.getvalue()


def test_a_plan(trained: Result, terminal: io.StringIO) -> None:
    printing.print_plan(trained.plan, printing.estimate(trained.plan, trained.store))
    assert "…" not in terminal.getvalue()
