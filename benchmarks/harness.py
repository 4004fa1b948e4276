"""Measure two sides in turn, so that what else the machine does falls on both, and say how their times compare."""

import json
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

import typer
from rich.console import Console
from rich.table import Table

from semidense.pipeline.plan.errors import told
from semidense.stages.compute.allocator import keep_freed_memory

keep_freed_memory()  # as the command line does, whose speed is measured
PAIRS = 5
FOLDER = Path("build/bench")
"""Where each benchmark leaves its JSON."""

Side = Callable[[], object]
"""Work to be timed; what it returns is dropped."""


@dataclass(frozen=True)
class Ratio:
    """How two sides compare.

    Attributes:
        what: what was compared, in words.
        pairs: the ratio of each pair of measurements, in the order in which they were taken.
        target: what the median should reach.
        at_most: whether the target is a limit from above.
        seconds: median time of each side; it says something of this machine at that hour alone.
    """

    what: str
    pairs: tuple[float, ...]
    target: float
    at_most: bool = False
    seconds: tuple[float, float] | None = None

    @property
    def median(self) -> float:
        """The figure to quote."""
        return median(self.pairs)

    @property
    def met(self) -> bool:
        """Whether the median reaches the target."""
        return self.median <= self.target if self.at_most else self.median >= self.target


def timed(side: Side) -> float:
    """Return the wall time of one call, seconds."""
    start = time.perf_counter()
    side()
    return time.perf_counter() - start


def compare(what: str, ours: Side, theirs: Side, target: float, *, work: float = 1.0, pairs: int = PAIRS) -> Ratio:
    """Time two sides in turn, each once to warm up and then ``pairs`` times.

    Args:
        what: what is compared, in words.
        ours: the side that should be fast.
        theirs: the side that it is compared with.
        target: how many times faster it should be.
        work: how many times the work of ``theirs`` a call of ``ours`` does.
        pairs: pairs of measurements.
    """
    ours(), theirs()
    times = [(timed(ours), timed(theirs)) for _ in range(pairs)]
    seconds = median(one for one, _ in times), median(other for _, other in times)
    return Ratio(what, tuple(work * other / one for one, other in times), target, seconds=seconds)


def median_seconds(side: Side, times: int = PAIRS) -> float:
    """Return the median wall time of some calls, after one to warm up."""
    side()
    return median(timed(side) for _ in range(times))


def report(name: str, ratios: Sequence[Ratio]) -> None:
    """Print a table and write ``build/bench/NAME.json``."""
    rows = [asdict(ratio) | {"median": ratio.median, "met": ratio.met} for ratio in ratios]
    write(name, {"ratios": rows})
    print_rows(rows)


def as_command(command: Callable[..., object]) -> None:
    """Run a benchmark as a command: a user's mistake is one line and exit code 2, as of ``pipeline``."""
    try:
        typer.run(command)
    except Exception as error:
        if (line := told(error)) is None:
            raise
        print(line, file=sys.stderr)
        raise SystemExit(2) from None


def write(name: str, content: Mapping[str, object]) -> None:
    """Write ``build/bench/NAME.json``, with what the machine is and how busy."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    document = {"name": name, "load": os.getloadavg()[0], "cores": os.cpu_count(), **content}
    (FOLDER / f"{name}.json").write_text(json.dumps(document, indent=2) + "\n")


def print_rows(rows: Sequence[dict[str, object]]) -> None:
    """Print ratios as ``report`` writes them."""
    table = Table("what", "median", "range", "target", "met", "seconds (a remark)", box=None)
    for row in rows:
        pairs, seconds = list(map(float, row["pairs"])), row["seconds"]  # type: ignore[call-overload]
        relation = "at most" if row["at_most"] else "at least"
        remark = " / ".join(f"{value:.3g}" for value in seconds) if seconds else ""  # type: ignore[attr-defined]
        table.add_row(
            str(row["what"]),
            f"{row['median']:.3g}",
            f"{min(pairs):.3g} - {max(pairs):.3g}",
            f"{relation} {row['target']:g}",
            "yes" if row["met"] else "NO",
            remark,
        )
    Console(width=160).print(table)
