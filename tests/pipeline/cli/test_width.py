"""What terminals of 80 and 60 columns show."""

import io
from dataclasses import replace

import pytest
from rich.console import Console

from semidense.cache import Store
from semidense.pipeline.api import Task, explain, open_store, status
from semidense.pipeline.cli import console as printing
from semidense.pipeline.cli.commands import inspect
from semidense.pipeline.cli.commands.cache import cleaning, listing
from semidense.pipeline.results.result import Result


@pytest.fixture(params=[80, 60])
def terminal(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    """A narrow terminal that all tables are printed on."""
    text = io.StringIO()
    narrow = Console(file=text, width=request.param, highlight=False)
    for module in (printing, listing, cleaning):
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


def test_a_sweep(trained: Result, terminal: io.StringIO) -> None:
    variants = ("semidense.R=0.5, costvolume.mode=fast", "semidense.R=0.9, costvolume.mode=guided")
    rows = [row | {"variant": each} for each in variants for row in trained.metrics]
    printing.print_sweep(rows, trained.mask_kinds())
    shown = terminal.getvalue()
    assert "…" not in shown
    assert max(map(len, shown.splitlines())) <= printing.results().width
    assert "\n\n" not in shown, "settings and figures must stand side by side"
    assert "wrong above 1 px" in " ".join(shown.split())
    assert all(mode in "".join(shown.split()) for mode in ("mode=fast", "mode=guided"))
    for row in trained.metrics:
        if row["mask"] == "nonocc" and row["threshold_px"] == 1:
            assert all(f" {row[name]:.2f} " in shown for name in ("bad", "invalid") if name in row)


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


def test_reasons_of_a_plan_are_folded_not_cut(trained_task: Task, terminal: io.StringIO) -> None:
    task = replace(trained_task, settings=[*trained_task.settings, "channels.rank_window=9"])
    printing.print_plan(status(task), printing.estimate(status(task), open_store(task.cache)))
    shown = terminal.getvalue()
    assert "…" not in shown
    assert "->" in shown
    assert all(line.split()[2] in ("hit", "stale", "missing") for line in shown.splitlines() if "test-0" in line)


def test_what_can_be_deleted(trained_task: Task, terminal: io.StringIO) -> None:
    cleaning.clean(trained_task.cache, cleaning.Wish(max_size="1B"), yes=False, as_json=False)
    assert "…" not in terminal.getvalue()
    assert "the cache is too large" in " ".join(terminal.getvalue().split())
