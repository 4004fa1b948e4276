"""Time of the cost volume against pixels x disparities, at four sizes: ``python -m benchmarks.growth``.

Linear growth makes the time a cell the same at every size. The sizes are taken in turn, and the figures are the time a
cell over that of the smallest size: what grows faster is above 1.
"""

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.harness import PAIRS, Ratio, as_command, report, timed
from semidense.pipeline.api import Task, run
from semidense.stages.matching.cost_volume import valid_columns

SIZES = ((64, 192, 16), (128, 192, 16), (128, 384, 16), (128, 384, 32))
"""Rows, columns, largest disparity: twice the cells each time."""


def cells(rows: int, columns: int, disparities: int) -> int:
    """Return how many cells are computed: those whose right pixel is in the image."""
    return rows * sum(end - first for first, end in (valid_columns(d, columns) for d in range(disparities + 1)))


def main(
    shrink: Annotated[int, typer.Option(help="divide rows and columns by this")] = 1,
    pairs: Annotated[int, typer.Option()] = PAIRS,
) -> None:
    """Time the stage at each size, one thread, everything above it cached."""
    sizes = [(rows // shrink, columns // shrink, count) for rows, columns, count in SIZES]
    found: list[list[float]] = [[] for _ in sizes]
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        tasks = [
            Task(f"synthetic:train=0,test=1,height={h},width={w},disparities={d}", cache=Path(folder))
            for h, w, d in sizes
        ]
        for pair in range(pairs + 1):
            for task, size, times in zip(tasks, sizes, found, strict=True):
                forced = ["costvolume"] if pair else []
                seconds = timed(lambda task=task, forced=forced: run(task, "costvolume", forced=forced, workers=1))  # type: ignore[misc]
                if pair:  # the first makes what is above it
                    times.append(seconds / cells(*size))
    report(
        "growth",
        [
            Ratio(
                f"time a cell, {cells(*size) / cells(*sizes[0]):.1f} times the cells",
                tuple(one / least for one, least in zip(times, found[0], strict=True)),
                1.15,
                at_most=True,
            )
            for size, times in zip(sizes[1:], found[1:], strict=True)
        ],
    )


if __name__ == "__main__":
    as_command(main)
