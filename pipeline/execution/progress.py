"""Show how a run goes on: one bar on a terminal, a line now and then elsewhere; always on stderr."""

import sys
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from semidense.cache import Store
from semidense.pipeline.plan.plan import Made, Plan
from semidense.pipeline.plan.steps import Step

if TYPE_CHECKING:
    from semidense.stages.compute.compiling import Compiling

LINE_SECONDS = 20.0
"""Where there is no terminal, a product that takes long says so at most this often."""


class ProgressWatch:
    """A ``Watch`` for people. Use it as a context manager: the bar is gone at its end.

    Args:
        announce: called with the plan and the cache before each run begins, such as to print how long it will take.
        detail: -1 says nothing; 0 names products that took a second or more; 1 names every product that is made.
    """

    def __init__(self, announce: Callable[[Plan, Store], None] | None = None, detail: int = 0) -> None:
        self._announce = announce if detail >= 0 else None
        self._detail = detail
        self._expected = False
        self._console = Console(stderr=True, quiet=detail < 0)
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.fields[note]}", style="dim", markup=False),
            console=self._console,
            transient=True,
            disable=detail < 0 or not sys.stderr.isatty(),
        )
        self._whole = self._bar.add_task("products", total=None, note="", visible=False)
        self._finished = 0
        self._rows: dict[str, _Row] = {}
        self._lock = threading.Lock()
        self._compiling: Compiling | None = None

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        if self._compiling:
            self._compiling.stop()

    def expect(self, plan: Plan, store: Store) -> None:
        """Take the plan of several runs as one: there is one announcement and one bar for all of them."""
        self.planned(plan, store)
        self._expected = True

    def planned(self, plan: Plan, store: Store) -> None:
        """Begin the bar anew: one step for each product to make."""
        if self._expected:
            return
        if self._announce:
            self._announce(plan, store)
        with self._lock:
            self._rows, self._finished = {}, 0
            self._bar.reset(self._whole, total=len(plan.todo()), note="", visible=True)

    def deployed(self, told: str) -> None:
        """Print a line about the cluster: its workers, and where its dashboard is."""
        self._console.print(told, highlight=False, soft_wrap=True, markup=False)

    def begun(self, step: Step, tiles: int) -> None:
        """Name the product beside the bar."""
        with self._lock:
            self._compiling = self._compiling or self._listen()
            self._rows[step.id] = _Row(step.name, time.monotonic(), tiles)
            self._show()

    def _listen(self) -> "Compiling":
        from semidense.stages.compute.compiling import Compiling  # with Numba, which a run that makes nothing spares

        return Compiling(lambda: self._console.print("compiling loops, once a machine: later runs begin at once"))

    def waiting(self, step: Step, holder: str) -> None:
        """Say that another process, or an equal scene of this run, is making the product."""
        self._console.print(
            f"{step.name}: waiting for {holder}, which is making it", highlight=False, soft_wrap=True, markup=False
        )

    def advanced(self, step: Step, done: int, total: int, note: str) -> None:
        """Move the bar: a tile counts one, a monitored stage says where it is."""
        with self._lock:
            row = self._rows.get(step.id)
            if row is None:
                return
            if step.stage.monitored and row.found is None:
                row.found = done - 1
            row.done = done if step.stage.monitored else row.done + done
            row.total, row.note = total, note
            self._show()
            self._say(step, row, total, note)

    def _show(self) -> None:
        """Move the bar to what is made, parts of products included, and name the product that was begun last."""
        rows = list(self._rows.values())
        parts = sum(row.done / row.total for row in rows if row.total)
        self._bar.update(self._whole, completed=self._finished + parts, note=str(rows[-1]) if rows else "")

    def _say(self, step: Step, row: "_Row", total: int, note: str) -> None:
        """Print a line where there is no bar and there is something to wait for."""
        now = time.monotonic()
        if self._bar.disable and row.done < total and now - row.said >= LINE_SECONDS:
            row.said = now
            left = (now - row.started) / (row.done - (row.found or 0)) * (total - row.done)
            text = f"{step.name}: {row.done} of {total}, about {left:.0f} s left {note}"
            self._console.print(text.rstrip(), highlight=False, soft_wrap=True, markup=False)

    def published(self, made: Made) -> None:
        """Count the product as made; print a line if that took a second or more."""
        with self._lock:
            self._rows.pop(made.step.id, None)
            self._finished += 1
            self._show()
            if self._detail > 0 or (not made.reused and made.seconds >= 1.0):
                self._console.print(_result_line(made), highlight=False, soft_wrap=True, markup=False)


def _result_line(made: Made) -> str:
    return f"reused {made.step.name}" if made.reused else f"made {made.step.name} in {made.seconds:.1f} s"


class _Row:
    """One product in the making."""

    def __init__(self, name: str, now: float, total: int) -> None:
        self.name, self.total = name, total
        self.started = self.said = now
        self.done, self.note = 0, ""
        self.found: int | None = None
        """Steps of a training that a checkpoint had already: they took none of the time since."""

    def __str__(self) -> str:
        """Return the product, its tiles or training steps, and its note."""
        parts = f" {self.done}/{self.total}" if self.total > 1 else ""
        return f"{self.name}{parts} {self.note}".rstrip()
