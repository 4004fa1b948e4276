"""What other settings do to maps of scenes that the networks have not seen: ``python -m benchmarks.held_out DATASET``.

The training scenes of all data sets are divided into halves, and each half is matched by networks of the other one
(``training.held_out``). So settings of the descriptors and of the summed costs are chosen without a look at the scenes
of the final figures. The maps are judged before filtering: no confidence is learnt, and a variant that changes the sums
alone takes the volumes of the others. For what comes of a filter, give the same settings to ``pipeline sweep``.
"""

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from benchmarks.harness import as_command, write
from semidense.pipeline.api import Task, run
from semidense.pipeline.execution.progress import ProgressWatch
from semidense.stages.metrics.errors import raw_bad

THRESHOLDS = (0.5, 1.0, 2.0, 3.0)
"""Largest errors of a right disparity, px."""
Errors = Mapping[str, list[float]]
"""Wrong pixels of each scene, %: one number for each of ``THRESHOLDS``."""


def main(
    dataset: Annotated[list[str], typer.Argument(help="training scenes, such as middlebury:DIR kitti2012:DIR")],
    variant: Annotated[
        list[str], typer.Option(help="settings, apart by a space: aggregated.p1=80 ...; '' changes none")
    ],
    preset: Annotated[str, typer.Option(help="named settings that all variants start from")] = "robust",
    cache: Annotated[Path | None, typer.Option(help="the cache's folder; default: the user's")] = None,
) -> None:
    """Print and write the mean raw error of each variant on the held-out scenes of each data set."""
    columns = [f"{spec.partition(':')[0]}, > {limit:g} px" for spec in dataset for limit in THRESHOLDS]
    table = Table("variant", *columns, box=None)
    found: dict[str, dict[str, Errors]] = {}
    for settings in variant:
        found[settings] = {}
        for spec in dataset:
            chosen = ("training.held_out=true", f"training.dataset={'+'.join(dataset)}", *settings.split())
            task = Task(spec, settings=chosen, train=True, cache=cache, preset=preset)
            found[settings][spec] = dict(_raw_errors(task))
        means = [mean for errors in found[settings].values() for mean in np.mean([*errors.values()], axis=0)]
        print(f"{settings or preset}: {', '.join(f'{mean:.2f}' for mean in means)}", file=sys.stderr)
        table.add_row(settings or preset, *(f"{mean:.2f}" for mean in means))
    write("held_out", {"preset": preset, "thresholds": THRESHOLDS, "variants": found})
    counts = [f"{len(errors)} of {spec.partition(':')[0]}" for spec, errors in found[variant[-1]].items()]
    print(f"raw error, %, nonocc, mean over the held-out scenes ({', '.join(counts)})")
    Console(width=200).print(table)


def _raw_errors(task: Task) -> Iterator[tuple[str, list[float]]]:
    """Yield each held-out scene with its raw errors, % above each of ``THRESHOLDS``."""
    with ProgressWatch() as watch:
        result = run(task, "disparity", watch=watch)
    judged = {result.made[target].step.scene for target, _ in result.plan.targets}
    for scene in task.open().scenes:
        if scene.name in judged:
            made, truth = result.open("disparity", scene.name)["disparity"].values, scene.load_truth()
            yield scene.name, [raw_bad(made, truth.disparity, truth.nonocc, limit) for limit in THRESHOLDS]


if __name__ == "__main__":
    as_command(main)
