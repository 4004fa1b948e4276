"""Two worker processes against two threads, and what the scheduler takes: ``python -m benchmarks.cluster``.

The workers run already and have compiled their loops: what is timed is a run. Every product of a scene is made again.
"""

import tempfile
from pathlib import Path
from statistics import mean
from typing import Annotated

import typer
from dask.diagnostics import Profiler

from benchmarks.harness import PAIRS, Ratio, as_command, compare, report
from benchmarks.simulation import handling_seconds
from benchmarks.workers import MADE
from semidense.pipeline.api import Task, run, status

SLOWER = 1.15
"""How many times as long two processes may take."""
OVERHEAD = 0.05
"""The part of a tile's work that the scheduler may take for it."""


def main(
    rows: Annotated[int, typer.Option()] = 512,
    columns: Annotated[int, typer.Option()] = 320,
    disparities: Annotated[int, typer.Option()] = 32,
    pairs: Annotated[int, typer.Option()] = PAIRS,
) -> None:
    """Compare whole runs, networks excepted, and one task of the scheduler with one tile."""
    from distributed import LocalCluster

    scene = f"synthetic:train=0,test=1,height={rows},width={columns},disparities={disparities}"
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=60) as cluster,
    ):
        task = Task(scene, cache=Path(folder))
        run(task)
        forced = [planned.step.product for planned in status(task).steps if planned.step.product in MADE]
        ratio = compare(
            "a run on two threads, in the time of one on two workers of a cluster",
            lambda: run(task, forced=forced, scheduler=cluster.scheduler_address),
            lambda: run(task, forced=forced, workers=2),
            1 / SLOWER,
            pairs=pairs,
        )
        with Profiler() as profiler:
            run(task, forced=forced, workers=2)
    tiles = [each.end_time - each.start_time for each in profiler.results if "-make_tile-" in each.key]
    parts = tuple(handling_seconds() / mean(tiles) for _ in range(pairs))
    report("cluster", [ratio, Ratio("a scheduler's time for a task, in that of a tile", parts, OVERHEAD, True)])


if __name__ == "__main__":
    as_command(main)
