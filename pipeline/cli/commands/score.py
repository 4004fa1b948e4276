"""The command ``score``, for maps that another matcher made. Nothing heavy is imported before it runs."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semidense.pipeline.cli.options import (
    CacheOption,
    FormatOption,
    JsonOption,
    SetOption,
    WorkersOption,
    map_formats,
    share,
)

if TYPE_CHECKING:
    from semidense.pipeline.pairs.score import Score


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
    calib: Annotated[
        list[str] | None, typer.Option(help="Calibration file, for depth and points; as for `match`.")
    ] = None,
    unit: Annotated[
        str | None, typer.Option(help="Unit of length in the calibration, if the file does not say: mm, cm or m.")
    ] = None,
    threshold: Annotated[
        float | None, typer.Option("--R", help="Keep disparities of at least this confidence, 0 to 1 [default: 0.9].")
    ] = None,
    density: Annotated[
        str | None,
        typer.Option(help="Instead of --R: keep the most confident pixels, this share of the image, such as 80%."),
    ] = None,
    max_error: Annotated[
        str | None,
        typer.Option(
            "--max-error",
            help="Instead of --R: keep as many pixels as this share of expected errors allows, such as 2%.",
        ),
    ] = None,
    formats: FormatOption = "pfm,png,tiff,npy",
    settings: SetOption = None,
    workers: WorkersOption = None,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Score a disparity map that any matcher made.

    Writes its confidence, and what is left of the map if only trusted disparities are kept.
    """
    from semidense.datasets.pairs.options import PairOptions, pair_spec
    from semidense.pipeline.api import Task
    from semidense.pipeline.pairs.wishes import Wishes
    from semidense.pipeline.plan.presets import FOREIGN

    options = PairOptions(tuple(calib or ()), unit, disparity=disparity, scale=scale, none=none)
    spec = pair_spec([left] if right is None else [left, right], options)
    wishes = Wishes(R=threshold, density=share("density", density), max_error=share("max-error", max_error))
    task = Task(spec, settings=tuple(settings or ()), cache=cache, preset=FOREIGN)
    scored, about = _carry_out(task, wishes, output, map_formats(formats), workers)
    for warning in scored.warnings:
        print(f"warning: {scored.scene.name}: {warning}", file=sys.stderr)
    if as_json:
        from semidense.pipeline.cli.console import print_json

        print_json({"pairs": [about]})
    else:
        _say(scored, about)


def _carry_out(task: Any, wishes: Any, output: Path, kinds: list[str], workers: int | None) -> tuple["Score", Any]:  # noqa: ANN401
    from dataclasses import replace

    from semidense.pipeline.cli.console import announce
    from semidense.pipeline.execution.progress import ProgressWatch
    from semidense.pipeline.pairs.match_files import require_place, save
    from semidense.pipeline.pairs.score import score_one

    task = replace(task, dataset=task.open())
    require_place(task.dataset.scenes, output, kinds)
    with ProgressWatch(announce) as watch:
        scored = score_one(task, wishes, watch=watch, workers=workers)
    return scored, save(scored, output, kinds)


def _say(scored: "Score", about: dict[str, Any]) -> None:
    """Print the result: how the map was read, what was kept, where it is."""
    import numpy as np

    from semidense.pipeline.cli.console import reuse_line
    from semidense.stages.evaluation.calibration.table import told

    known = np.isfinite(scored.raw)
    low, high = np.nanmin(scored.raw), np.nanmax(scored.raw)
    print(f"{scored.scene.name}: {about['rows']} x {about['columns']} px")
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
