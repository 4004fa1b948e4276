"""The command ``match``, for a user's own pairs. Nothing heavy is imported before it runs."""

import sys
from collections.abc import Sequence
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
    ModeOption,
    PresetOption,
    QuietOption,
    SchedulerOption,
    SetOption,
    ThresholdOption,
    UnitOption,
    VerboseOption,
    WorkersOption,
    chosen,
    chosen_preset,
    config_file,
    map_formats,
    share,
)
from semidense.pipeline.plan.presets import OWN_PAIRS

if TYPE_CHECKING:
    from semidense.pipeline.api import Task
    from semidense.pipeline.pairs.match import Match
    from semidense.pipeline.pairs.wishes import Wishes


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(match)


def match(
    left: Annotated[
        str,
        typer.Argument(
            help="The left view: an image; for many pairs a folder, a pattern with one *, or a list (.csv)."
        ),
    ],
    right: Annotated[
        str | None, typer.Argument(help="The right view, given like LEFT; leave it out after a list.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Write everything to this folder.")] = Path("matched"),
    min_disp: Annotated[
        int | None,
        typer.Option(help="Smallest disparity to search, px [default: from the calibration, else estimated]."),
    ] = None,
    max_disp: Annotated[
        int | None, typer.Option(help="Largest disparity to search, px [default: as for --min-disp].")
    ] = None,
    calib: CalibOption = None,
    split: Annotated[
        str | None,
        typer.Option(help="LEFT is one image of both views: side-by-side, or over-under (the left view above)."),
    ] = None,
    unit: UnitOption = None,
    threshold: ThresholdOption = None,
    density: DensityOption = None,
    max_error: MaxErrorOption = None,
    calibrated: Annotated[
        bool,
        typer.Option(
            "--calibrated",
            help="Turn the confidence into a measured probability of being right, which --R then means; needs a "
            "calibration, which the presets have.",
        ),
    ] = False,
    within: Annotated[
        float | None,
        typer.Option(
            help="Error up to which --max-error and --calibrated count a disparity as right, px; --preset robust knows "
            "1, 2 and 3. [default: 1]"
        ),
    ] = None,
    left_right: Annotated[
        bool, typer.Option("--left-right", help="Drop disparities that the right view's map contradicts.")
    ] = False,
    subpixel: Annotated[
        bool,
        typer.Option(
            "--subpixel", help="Refine whole disparities to fractions of a pixel; --preset robust does so without it."
        ),
    ] = False,
    fill: Annotated[
        bool,
        typer.Option(
            "--fill", help="Fill holes with the background beside them: the map has no holes, but is partly guessed."
        ),
    ] = False,
    right_view: Annotated[bool, typer.Option("--right-view", help="Also write the right view's raw map.")] = False,
    formats: FormatOption = "pfm,png,tiff,npy",
    scene: Annotated[
        list[str] | None, typer.Option("--scene", help="Match this pair only; repeat the option for several.")
    ] = None,
    settings: SetOption = None,
    preset: PresetOption = None,
    mode: ModeOption = None,
    config: ConfigOption = None,
    dry_run: DryRunOption = False,
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    cache: CacheOption = None,
    verbose: VerboseOption = False,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Match your own rectified pair, or many.

    Writes disparities, confidence and, with a calibration, depth and points as files.
    """
    from semidense.datasets.pairs.options import PairOptions, pair_spec
    from semidense.pipeline.api import Task
    from semidense.pipeline.pairs.wishes import Wishes

    options = PairOptions(tuple(calib or ()), unit, min_disp, max_disp, split)
    sides = [left] if right is None else [left, right]
    named = chosen_preset(preset, config, OWN_PAIRS)
    task = Task(
        pair_spec(sides, options), tuple(scene or ()), chosen(settings, mode), config_file(config), False, cache, named
    )
    wishes = Wishes(
        R=threshold,
        density=share("density", density),
        max_error=share("max-error", max_error),
        calibrated=calibrated,
        within=within,
        left_right=left_right,
        subpixel=subpixel,
        fill=fill,
        right_view=right_view,
    )
    kinds = map_formats(formats)
    if dry_run:
        _plan(task, wishes, as_json)
    else:
        _carry_out(task, wishes, output, kinds, {"scheduler": scheduler, "workers": workers}, verbose - quiet, as_json)


def _plan(task: "Task", wishes: "Wishes", as_json: bool) -> None:
    from semidense.pipeline import api
    from semidense.pipeline.cli import console
    from semidense.pipeline.pairs.wishes import wished

    plan = api.status(wished(task, wishes), wishes.product)
    console.show_plan(plan, api.open_store(task.cache), as_json)


def _carry_out(
    task: "Task", wishes: "Wishes", output: Path, kinds: Sequence[str], how: dict[str, Any], detail: int, as_json: bool
) -> None:
    from dataclasses import replace

    from semidense.pipeline.cli import console
    from semidense.pipeline.execution.progress import ProgressWatch
    from semidense.pipeline.pairs.match import match_all
    from semidense.pipeline.pairs.match_files import require_place, save_all

    task = replace(task, dataset=task.open())
    require_place(task.open().scenes, output, kinds)
    with ProgressWatch(console.announce, detail) as watch:
        found = match_all(task, wishes, watch=watch, **how)
    summaries = save_all(found, output, kinds)
    for each in found:
        for warning in each.warnings:
            where = " (see survey.png)" if warning in each.misfits else ""
            print(f"warning: {each.scene.name}: {warning}{where}", file=sys.stderr)
    if as_json:
        console.print_json({"pairs": summaries})
        return
    for each, about in zip(found, summaries, strict=True):
        _say(each, about)
    if len(found) == 1:
        _draw(found[0])
    print(console.reuse_line(_results(found)))


_ESTIMATED = {
    (): "",
    ("minimum",): " (the smallest estimated from the images)",
    ("maximum",): " (the largest estimated from the images)",
    ("minimum", "maximum"): " (estimated from the images)",
}
"""What is told of a range, by its ends that were not given."""


def _say(match: "Match", about: dict[str, Any]) -> None:
    """Print one pair's result: what was searched, what was kept, where it is."""
    from semidense.stages.evaluation.calibration.table import told

    low, high = match.disparities.minimum, match.disparities.maximum
    print(
        f"{match.scene.name}: {about['rows']} rows x {about['columns']} columns, disparities {low} to {high} px"
        f"{_ESTIMATED[match.scene.open_ends]}"
    )
    if match.shifts:
        print(
            "  shifted the rows of the right view by {:+.1f} to {:+.1f} px to those of the left".format(*match.shifts)
        )
    kept = about["density_percent"] - about["guessed_percent"]
    print(f"  kept {kept:.1f} % of the pixels, at R = {told(match.R)} ({about['R_from']})")
    if "R_basis" in about:
        print(f"  {about['R_basis']}")
    if match.wishes.fill:
        print(f"  {about['guessed_percent']:.1f} % are filled in: guesses (guessed.png)")
    for note in about["notes"]:
        print(f"  {note}")
    print(f"  wrote {len(about['files']) + 1} files to {about['folder']}; summary.json says what each holds")


def _draw(match: "Match") -> None:
    """Draw the map of a single pair, if stdout is a terminal that can show it."""
    from rich.console import Console

    from semidense.pipeline.cli.terminal import can_draw, draw_picture, small_disparity

    if can_draw(Console()):
        draw_picture(*small_disparity(match.disparity))


def _results(found: "Sequence[Match]") -> list[Any]:
    """Return every result once, as it was first met: a later run only finds again what an earlier one made."""
    first: dict[str, Any] = {}
    for run in (found[0].others[0], found[0].result, *found[0].others[1:]):
        for made in run.made.values():
            first.setdefault(made.key, made)
    return list(first.values())
