"""The command ``compare``. Nothing heavy is imported before it runs."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from semidense.pipeline.cli.options import (
    CacheOption,
    ConfigOption,
    DryRunOption,
    JsonOption,
    ModeOption,
    PresetOption,
    QuietOption,
    SceneOption,
    SchedulerOption,
    SetOption,
    VerboseOption,
    WorkersOption,
    chosen,
    chosen_preset,
    config_file,
)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(compare)


def compare(
    dataset: Annotated[str, typer.Argument(help="Scenes with a ground truth, such as middlebury:DIR.")] = "motorcycle",
    scene: SceneOption = None,
    experiment: Annotated[
        list[str] | None,
        typer.Option("--experiment", help="Run this experiment: raw, density or auc; may be repeated [default: all]."),
    ] = None,
    train_on: Annotated[
        str | None,
        typer.Option(
            "--train-on", help="Train on this dataset what must be trained: O1, CCNN, networks of fewer channels."
        ),
    ] = None,
    protocol: Annotated[
        list[str] | None,
        typer.Option(
            "--protocol",
            help="Also train and test as the paper does: same (train on the tested pairs) or folds (train on half of "
            "them and --train-on, test on the other half); may be repeated.",
        ),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(
            "--without",
            help="Leave out a matcher or measure, such as mc_cnn_accurate; ablation leaves out the networks of fewer "
            "channels. May be repeated.",
        ),
    ] = None,
    maps: Annotated[
        list[str] | None,
        typer.Option(
            "--map",
            help="Also score the maps of another matcher: NAME=PATTERN, a path with * for the scene's name; add "
            ",scale=256 or ,none=-1 if the files do not tell. May be repeated.",
        ),
    ] = None,
    threshold: Annotated[
        float, typer.Option("--threshold", help="Error in px above which tables and figures call a pixel wrong.")
    ] = 1.0,
    settings: SetOption = None,
    preset: PresetOption = None,
    mode: ModeOption = None,
    config: ConfigOption = None,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="Write comparison.csv, comparison.json and the figures to this folder."),
    ] = Path("comparison"),
    dry_run: DryRunOption = False,
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    cache: CacheOption = None,
    verbose: VerboseOption = False,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Compare other matchers with the two networks.

    Runs the paper's experiments: raw maps, error at equal density, confidence measures.
    """
    from semidense.pipeline import api
    from semidense.pipeline.cli import console
    from semidense.pipeline.comparison import files as comparison_report
    from semidense.pipeline.comparison import tables
    from semidense.pipeline.comparison.experiments import carry_out_comparison
    from semidense.pipeline.comparison.prepared import EXPERIMENTS, prepare
    from semidense.pipeline.execution.progress import ProgressWatch
    from semidense.pipeline.plan.errors import UsageError
    from semidense.stages.metrics.errors import THRESHOLDS

    if threshold not in THRESHOLDS:
        offered = ", ".join(f"{each:g}" for each in THRESHOLDS)
        raise UsageError(f"--threshold {threshold:g}: figures are worked out for {offered} px")
    named = chosen_preset(preset, config)
    task = api.Task(dataset, tuple(scene or ()), chosen(settings, mode), config_file(config), False, cache, named)
    prepared = prepare(
        task, experiment or EXPERIMENTS, train_on, protocol or (), without=without or (), maps=_named_maps(maps or ())
    )
    store = api.open_store(cache)
    if dry_run:
        return console.show_plan(prepared.plan(), store, as_json)
    comparison_report.require_comparison_place(output, prepared.experiments)
    with ProgressWatch(console.announce, verbose - quiet) as watch:
        watch.expect(prepared.plan(), store)
        found = carry_out_comparison(prepared, watch=watch, scheduler=scheduler, workers=workers)
    files = comparison_report.write_comparison(found, output, threshold)
    if as_json:
        return console.print_json(comparison_report.as_json(found, files))
    tables.print_comparison(found, found.result.mask_kinds().values(), threshold)
    console.print_notes(found.notes)
    for file in files:
        typer.echo(f"wrote {file}")
    typer.echo(console.reuse_line(found.result.made.values()))
    return None


def _named_maps(texts: Sequence[str]) -> dict[str, str]:
    """Return what ``NAME=PATTERN`` says, by name.

    Raises:
        UsageError: if a text has another form, or a name comes twice.
    """
    from semidense.pipeline.plan.errors import UsageError

    named: dict[str, str] = {}
    for text in texts:
        name, _, pattern = text.partition("=")
        if not (name and pattern) or name in named:
            raise UsageError(f"--map {text}: write NAME=PATTERN, such as raft=raft/*.pfm, each name once")
        named[name] = pattern
    return named
