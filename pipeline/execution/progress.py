"""Show how a run goes on: a bar a product on a terminal, a line now and then elsewhere; always on stderr."""

import sys
import threading
import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from semidense.cache import Draft
from semidense.pipeline.plan.plan import Made
from semidense.pipeline.plan.steps import Step

if TYPE_CHECKING:
    from semidense.stages.compute.compiling import Compiling

LINE_SECONDS = 20.0
"""Where there is no terminal, a product that takes long says so at most this often."""


class RateColumn(ProgressColumn):
    """Steps or tiles a second."""

    def render(self, task: Task) -> Text:
        """Return the rate, once there is one."""
        return Text(f"{task.speed:.2g}/s" if task.speed else "", style="dim")


class ProgressWatch:
    """A ``Watch`` for people. Use it as a context manager: the bars are gone at its end."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)
        self._bars = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            RateColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.fields[note]}", style="dim"),
            console=self._console,
            transient=True,
            disable=not sys.stderr.isatty(),
        )
        self._rows: dict[str, _Row] = {}
        self._lock = threading.Lock()
        self._compiling: Compiling | None = None

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bars.stop()
        if self._compiling:
            self._compiling.stop()

    def begun(self, step: Step, draft: Draft, tiles: int) -> None:
        """Add a bar."""
        with self._lock:
            self._compiling = self._compiling or self._listen()
            task = self._bars.add_task(step.name, total=tiles, note="")
            self._rows[step.id] = _Row(int(task), time.monotonic())

    def _listen(self) -> "Compiling":
        from semidense.stages.compute.compiling import Compiling  # with Numba, which a run that makes nothing spares

        return Compiling(lambda: self._console.print("compiling loops, once a machine: later runs begin at once"))

    def waiting(self, step: Step, holder: str) -> None:
        """Say that another process is making the product."""
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
            self._bars.update(row.task, completed=row.done, total=total, note=note)  # type: ignore[arg-type]
            self._say(step, row, total, note)

    def _say(self, step: Step, row: "_Row", total: int, note: str) -> None:
        """Print a line where there are no bars and there is something to wait for."""
        now = time.monotonic()
        if self._bars.disable and row.done < total and now - row.said >= LINE_SECONDS:
            row.said = now
            left = (now - row.started) / (row.done - (row.found or 0)) * (total - row.done)
            text = f"{step.name}: {row.done} of {total}, about {left:.0f} s left {note}"
            self._console.print(text.rstrip(), highlight=False, soft_wrap=True, markup=False)

    def published(self, made: Made) -> None:
        """Turn the bar into a line, if the product took long enough to be worth one."""
        with self._lock:
            row = self._rows.pop(made.step.id, None)
            if row is not None:
                self._bars.remove_task(row.task)  # type: ignore[arg-type]
            if not made.reused and made.seconds >= 1.0:
                self._console.print(
                    f"made {made.step.name} in {made.seconds:.1f} s", highlight=False, soft_wrap=True, markup=False
                )


class _Row:
    """One product in the making."""

    def __init__(self, task: int, now: float) -> None:
        self.task = task
        self.started = self.said = now
        self.done = 0
        self.found: int | None = None
        """Steps of a training that a checkpoint had already: they took none of the time since."""
