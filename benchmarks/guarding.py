"""What guarding costs: hashing, syncing, checking, locks and leases, as a share of the time of the stage they guard.

    python -m benchmarks.guarding [DATASET] [--upto PRODUCT] [--json FILE]

Runs a dataset in an empty cache of its own, and a second time over the full one, whose every byte is checked again.
Both shares are of one run, so other load on the machine falls on both sides.
"""

import json
import platform
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any
from unittest.mock import patch

import typer
from rich.console import Console
from rich.table import Table

from benchmarks.harness import as_command
from semidense.cache.entries import check
from semidense.pipeline.api import Task, run
from semidense.pipeline.results.result import Result

TARGET = 3.0
"""Percent of the stage's time."""
LONG = 1.0
"""Seconds from which on a stage is held to the target; shorter ones count in the whole."""
GUARDS = (
    "semidense.cache.entries.folder.inspect",
    "semidense.cache.entries.folder.inspect_data",
    "semidense.cache.entries.publish.inspect",
    "semidense.cache.entries.publish.remove_strays",
    "semidense.cache.entries.publish.seal",
    "semidense.cache.entries.publish.commit",
    "semidense.cache.entries.draft.FolderDraft._complete",
    "semidense.cache.store.Store.claim",
    "semidense.cache.processes.lease.FolderLease.add",
)
TASKS = ("begin", "create_arrays", "make_tile", "make_whole", "publish")


class Clock:
    """Adds up, by product, the time of tasks and the part of it that is guarding."""

    def __init__(self) -> None:
        self.task: dict[str, float] = defaultdict(float)
        self.guard: dict[str, float] = defaultdict(float)
        self._here = threading.local()

    def timed_task(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Wrap a task of `semidense.pipeline.execution.tasks`: whatever it does counts for its step's product."""

        def task(*arguments: Any, **options: Any) -> Any:  # noqa: ANN401
            step = next(each for each in arguments if hasattr(each, "stage") or hasattr(each, "step"))
            self._here.product = getattr(step, "step", step).product
            with self._adding(self.task):
                return function(*arguments, **options)

        return task

    def timed_guard(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Wrap a guard; a guard inside a guard counts once."""

        def guard(*arguments: Any, **options: Any) -> Any:  # noqa: ANN401
            if getattr(self._here, "inside", False):
                return function(*arguments, **options)
            self._here.inside = True
            try:
                with self._adding(self.guard):
                    return function(*arguments, **options)
            finally:
                self._here.inside = False

        return guard

    @contextmanager
    def _adding(self, times: dict[str, float]) -> Iterator[None]:
        started = time.perf_counter()
        try:
            yield
        finally:
            times[getattr(self._here, "product", "planning")] += time.perf_counter() - started


@contextmanager
def clocked() -> Iterator[Clock]:
    """Time all tasks and guards of this process."""
    from contextlib import ExitStack

    from semidense.pipeline.execution import tasks

    clock = Clock()
    with ExitStack() as stack:
        for name in TASKS:
            stack.enter_context(patch.object(tasks, name, clock.timed_task(getattr(tasks, name))))
        for name in GUARDS:
            owner, _, attribute = name.rpartition(".")
            target = _resolve(owner)
            stack.enter_context(patch.object(target, attribute, clock.timed_guard(getattr(target, attribute))))
        yield clock


def _resolve(name: str) -> Any:  # noqa: ANN401
    from pkgutil import resolve_name

    return resolve_name(name)


def measure(dataset: str, upto: str, folder: Path) -> tuple[list[dict[str, Any]], dict[str, float]]:
    """Return a row a product, and the figures of the whole."""
    with clocked() as clock:
        made = run(Task(dataset, cache=folder), upto)
    rows = [
        {"product": name, "seconds": seconds, "guard": clock.guard[name], "percent": 100 * clock.guard[name] / seconds}
        for name, seconds in clock.task.items()
    ]
    seconds, guard = (sum(row[name] for row in rows) for name in ("seconds", "guard"))
    return rows, {"seconds": seconds, "guard": guard, "percent": 100 * guard / seconds, **_again(dataset, upto, made)}


def _again(dataset: str, upto: str, made: Result) -> dict[str, float]:
    """Return what a run takes that finds everything and checks every byte."""
    check.forget()
    started = time.perf_counter()
    run(Task(dataset, cache=made.store.root), upto)
    size = sum(entry.size for entry in made.store.entries())
    return {"all_hits_seconds": time.perf_counter() - started, "megabytes": size / 1e6}


def guarding(
    dataset: Annotated[str, typer.Argument(help="such as synthetic")] = "motorcycle",
    upto: Annotated[str, typer.Option(help="the product to stop at")] = "metrics",
    out: Annotated[Path | None, typer.Option("--json", help="write the figures here")] = None,
) -> None:
    """Measure, print a table, write JSON; exit with 1 if a long stage, or the whole, is above the target."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        rows, whole = measure(dataset, upto, Path(folder) / "cache")
    table = Table("product", "stage s", "guarding s", "%", box=None)
    for row in [*sorted(rows, key=lambda row: -row["seconds"]), {"product": "whole"} | whole]:
        table.add_row(row["product"], *(f"{row[name]:.3f}" for name in ("seconds", "guard")), f"{row['percent']:.2f}")
    Console(width=120).print(table)
    print(f"all hits: {whole['megabytes']:.1f} MB checked and planned in {whole['all_hits_seconds']:.2f} s")
    if out:
        record = {"name": "guarding", "figures": {"dataset": dataset, **whole}, "stages": rows, "target": TARGET}
        out.write_text(json.dumps(record | {"machine": platform.processor() or platform.machine()}, indent=1) + "\n")
    held = [whole, *(row for row in rows if row["seconds"] >= LONG)]
    raise typer.Exit(int(any(row["percent"] > TARGET for row in held)))


if __name__ == "__main__":
    as_command(guarding)
