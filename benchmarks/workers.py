"""Two workers against one, the same plan: ``python -m benchmarks.workers``. Every product of a scene is made again.

The scene is as high as a quarter-size one, so that each stage has tiles for both.
"""

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.harness import PAIRS, as_command, compare, report
from semidense.pipeline.api import Task, run, status
from semidense.stages.catalog import CATALOG

MADE = ("images", "truth", *(stage.product for stage in CATALOG if stage.scope == "scene"))


def main(
    rows: Annotated[int, typer.Option()] = 512,
    columns: Annotated[int, typer.Option()] = 320,
    disparities: Annotated[int, typer.Option()] = 32,
    pairs: Annotated[int, typer.Option()] = PAIRS,
) -> None:
    """Compare whole runs, networks excepted."""
    scene = f"synthetic:train=0,test=1,height={rows},width={columns},disparities={disparities}"
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        task = Task(scene, cache=Path(folder))
        run(task)
        forced = [planned.step.product for planned in status(task).steps if planned.step.product in MADE]
        ratio = compare(
            "a run with two workers, times one",
            lambda: run(task, forced=forced, workers=2),
            lambda: run(task, forced=forced, workers=1),
            1.6,
            pairs=pairs,
        )
    report("workers", [ratio])


if __name__ == "__main__":
    as_command(main)
