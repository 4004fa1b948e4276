"""The command ``score``, for maps that another matcher made. Nothing heavy is imported before it runs."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semidense.pipeline.cli.options import (
    CacheOption,
    CalibOption,
    ConfigOption,
    DensityOption,
    DryRunOption,
    FormatOption,
    JsonOption,
    MaxErrorOption,
    QuietOption,
    SetOption,
    ThresholdOption,
    UnitOption,
    VerboseOption,
    WorkersOption,
    config_file,
    map_formats,
    share,
)

if TYPE_CHECKING:
    from semidense.pipeline.api import Task
    from semidense.pipeline.pairs.score import Score
    from semidense.pipeline.pairs.wishes import Wishes


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(score)


def score(
    left: Annotated[str, typer.Argument(help="The left view: an image.")],
    disparity: Annotated[str, typer.Argument(help="Its disparity map by any matcher: PFM, PNG, TIFF or NPY.")],
    right: Annotated[
        str | None, typer.Argument(help="The right view, if there is one: the score is much better with it.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Write everything to this folder.")] = Path("scored"),
    scale: Annotated[
        float | None,
        typer.Option(
            help="Stored value of 1 px: 256 for KITTI, 16 for OpenCV; below 0 turns the sign [default: recognised]."
        ),
    ] = None,
    none: Annotated[
        float | None,
        typer.Option(help="Stored value of pixels without a disparity, such as -1 [default: recognised]."),
    ] = None,
    calib: CalibOption = None,
    unit: UnitOption = None,
    threshold: ThresholdOption = None,
    density: DensityOption = None,
    max_error: MaxErrorOption = None,
    formats: FormatOption = "pfm,png,tiff,npy",
    settings: SetOption = None,
    config: ConfigOption = None,
    dry_run: DryRunOption = False,
    workers: WorkersOption = None,
    cache: CacheOption = None,
    verbose: VerboseOption = False,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Score a disparity map that any matcher made.

    Writes its confidence, and what is left of the map if only trusted disparities are kept.
    """
    from semidense.datasets.pairs.options import PairOptions, pair_spec
    from semidense.pipeline import api
    from semidense.pipeline.cli import console
    from semidense.pipeline.pairs.wishes import Wishes, with_wishes
    from semidense.pipeline.plan.errors import UsageError
    from semidense.pipeline.plan.presets import FOREIGN

    if right and Path(right).suffix.lower() in (".npy", ".pfm"):
        raise UsageError(f"{right}: the map comes second: pipeline score LEFT MAP RIGHT")
    options = PairOptions(tuple(calib or ()), unit, disparity=disparity, scale=scale, none=none)
    spec = pair_spec([left] if right is None else [left, right], options)
    wishes = Wishes(R=threshold, density=share("density", density), max_error=share("max-error", max_error))
    task = api.Task(spec, (), tuple(settings or ()), config_file(config), cache=cache, preset=FOREIGN)
    kinds = map_formats(formats)
    if dry_run:
        plan = api.status(with_wishes(task, wishes), wishes.product)
        return console.show_plan(plan, api.open_store(cache), as_json)
    scored, about = _carry_out(task, wishes, output, kinds, workers, verbose - quiet)
    for warning in scored.warnings:
        print(f"warning: {scored.scene.name}: {warning}", file=sys.stderr)
    if as_json:
        return console.print_json({"pairs": [about]})
    return _say(scored, about)


def _carry_out(
    task: "Task", wishes: "Wishes", output: Path, kinds: list[str], workers: int | None, detail: int
) -> tuple["Score", dict[str, Any]]:
    from dataclasses import replace

    from semidense.pipeline.cli.console import announce
    from semidense.pipeline.execution.progress import ProgressWatch
    from semidense.pipeline.pairs.match_files import require_place, save
    from semidense.pipeline.pairs.score import score_one

    task = replace(task, dataset=task.open())
    require_place(task.open().scenes, output, kinds)
    with ProgressWatch(announce, detail) as watch:
        scored = score_one(task, wishes, watch=watch, workers=workers)
    return scored, save(scored, output, kinds)


def _say(scored: "Score", about: dict[str, Any]) -> None:
    """Print the result: how the map was read, what was kept, where it is."""
    import numpy as np

    from semidense.pipeline.cli.console import reuse_line
    from semidense.stages.evaluation.calibration.table import told

    known = np.isfinite(scored.raw)
    low, high = np.nanmin(scored.raw), np.nanmax(scored.raw)
    print(f"{scored.scene.name}: {about['rows']} rows x {about['columns']} columns")
    print(
        f"  read {about['map']} with {about['map_reading']['scale']:g} to a pixel: {100 * known.mean():.1f} % of the "
        f"pixels have a disparity, {low:.4g} to {high:.4g} px"
    )
    print(f"  kept {about['density_percent']:.1f} % of the pixels, at R = {told(scored.R)} ({about['R_from']})")
    if "R_basis" in about:
        print(f"  {about['R_basis']}")
    for note in about["notes"]:
        print(f"  {note}")
    print(f"  wrote {len(about['files']) + 1} files to {about['folder']}; summary.json says what each holds")
    print(reuse_line(scored.result.made.values()))
