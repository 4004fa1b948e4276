"""What other ways of training do on scenes held out: ``python -m benchmarks.recipe DATASET --variant SETTINGS``.

The networks of each variant's cost volume (with ``costvolume.mode=fast``: the descriptor-Net) are trained anew on the
training scenes but those held out and their siblings, and the raw maps are judged on rows in the middle of the held-out
scenes. So settings are chosen without a look at the scenes of the final figures. To compare at equal cost, give each
variant the steps that take as long; the table says how long they took.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, cast

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from benchmarks.harness import as_command, write
from semidense.datasets import SceneSource, open_dataset
from semidense.pipeline.api import Task, carry_out
from semidense.pipeline.execution.progress import ProgressWatch
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.steps import Request
from semidense.pipeline.plan.training_split import families, training_scenes
from semidense.pipeline.results.result import Result
from semidense.stages.compute.precision import resolve
from semidense.stages.disparity.winner_takes_all import winner_take_all
from semidense.stages.matching.cost_volume import compute_costs
from semidense.stages.matching.declaration import CostVolumeParams
from semidense.stages.metrics.errors import raw_bad

HELD = ("Laundry", "Bowling2", "Lampshade1", "Midd1", "Plastic", "Wood2")
"""Scenes of Middlebury 2005 and 2006, easy and hard."""
THRESHOLD = 1.0
"""Largest error of a right disparity, px."""


def main(
    dataset: Annotated[str, typer.Argument(help="the training scenes, such as middlebury:DIR")],
    variant: Annotated[list[str], typer.Option(help="settings, apart by a space: matching_net.steps=500 ...")],
    held: Annotated[list[str] | None, typer.Option(help="scenes held out, instead of the usual ones")] = None,
    rows: Annotated[int, typer.Option(help="rows of each that are judged", min=1)] = 64,
    cache: Annotated[Path | None, typer.Option(help="the cache's folder; default: the user's")] = None,
) -> None:
    """Print and write the raw error of each variant on each held-out scene."""
    tested, learnt = divide(training_scenes(open_dataset(dataset)), held or HELD)
    table = Table("variant", "trained, s", *(scene.name for scene in tested), "mean", box=None)
    found = {}
    for settings in variant:
        config = Config.load(settings=settings.split())
        params = cast(CostVolumeParams, config.section("costvolume"))
        nets = params.inputs[1:]
        request = Request(
            replace(open_dataset(dataset), scenes=tested), {"": config},
            "channels", train=True, training=learnt, also=("truth", *nets),
        )  # fmt: skip
        with ProgressWatch() as watch:
            result = carry_out(Task(dataset, cache=cache), request, (), watch, None, None)
        seconds = sum(result.store.require(result.find(net).key).seconds for net in nets)
        errors = {scene.name: raw_error(result, scene, rows, params) for scene in tested}
        found[settings] = {"seconds": seconds, "raw_bad": errors}
        values = (*errors.values(), float(np.mean([*errors.values()])))
        print(f"{settings}: {values[-1]:.2f} % in the mean", file=sys.stderr)
        table.add_row(settings, f"{seconds:.0f}", *(f"{value:.2f}" for value in values))
    names = [scene.name for scene in tested]
    write("recipe", {"held": names, "rows": rows, "scenes": len(learnt), "variants": found})
    print(f"raw error, %, > {THRESHOLD:g} px, nonocc, {rows} rows of each; trained on {len(learnt)} other scenes")
    Console(width=200).print(table)


def divide(
    scenes: Sequence[SceneSource], held: Sequence[str]
) -> tuple[tuple[SceneSource, ...], tuple[SceneSource, ...]]:
    """Return the scenes that are held out, and those that are neither held out nor siblings of one that is.

    Raises:
        UsageError: if a name fits no scene, or nothing is left to train on.
    """
    tested = tuple(scene for scene in scenes if scene.name.rsplit("/", 1)[-1] in held)
    if len(tested) != len(set(held)):
        known = ", ".join(scene.name.rsplit("/", 1)[-1] for scene in scenes)
        raise UsageError(f"--held {', '.join(held)}: the training scenes are {known}")
    names = [scene.name for scene in scenes]
    family_of = dict(zip(names, families(names), strict=True))
    kept = {family_of[scene.name] for scene in tested}
    learnt = tuple(scene for scene in scenes if family_of[scene.name] not in kept)
    if not learnt:
        raise UsageError(f"--held {', '.join(held)}: no scene is left to train on")
    return tested, learnt


def raw_error(result: Result, scene: SceneSource, rows: int, params: CostVolumeParams) -> float:
    """Return the raw error (> 1 px, nonocc, %) of the trained networks on rows in the middle of a scene."""
    found, margin = scene.disparities, params.context
    views = result.open("channels", scene.name)["channels"].values
    first = max(0, (views.shape[2] - rows) // 2)
    padded = np.pad(views, ((0, 0), (0, 0), (margin, margin), (margin, margin)), mode="edge")
    given = {net: {"parameters": result.open(net)["parameters"].values} for net in params.inputs[1:]}
    given["channels"] = {"channels": padded[:, :, first : first + rows + 2 * margin]}
    own = {"d_min": found.minimum, "d_max": found.maximum, "precision": resolve("auto")}
    made = winner_take_all(compute_costs(params.model_copy(update=own), given)["cost"], found.minimum)
    truth = result.open("truth", scene.name).isel(y=slice(first, first + rows))
    return raw_bad(made, truth["disparity"].values, truth["nonocc"].values, THRESHOLD)


if __name__ == "__main__":
    as_command(main)
