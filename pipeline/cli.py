"""The command line. Nothing heavy is imported before a command runs: ``--help`` must answer at once."""

import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline import cli_compare, cli_match, cli_view
from pipeline.cli_cache import cache_app
from pipeline.cli_options import (
    CacheOption,
    ConfigOption,
    DatasetArgument,
    DryRunOption,
    ForceOption,
    JsonOption,
    OutputOption,
    ProductArgument,
    SceneOption,
    SchedulerOption,
    SetOption,
    TrainOption,
    UptoOption,
    WorkersOption,
)

if TYPE_CHECKING:
    from pipeline.api import Result, Task
    from pipeline.plan import Plan

app = typer.Typer(
    help="Semi-dense stereo matching with two CNNs; every stage is cached.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # rich takes as long to import as all the rest of --help
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
data_app = typer.Typer(help="Look at datasets.", no_args_is_help=True)
app.add_typer(cache_app, name="cache")
app.add_typer(data_app, name="data")


@app.command()
def run(
    dataset: DatasetArgument = "motorcycle",
    upto: UptoOption = "metrics",
    scene: SceneOption = None,
    settings: SetOption = None,
    config: ConfigOption = None,
    train: TrainOption = False,
    dry_run: DryRunOption = False,
    force: ForceOption = None,
    output: OutputOption = None,
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Make a dataset's products, reusing all that is cached."""
    from pipeline import api, console
    from pipeline.progress import ProgressWatch

    task = _task(dataset, scene, settings, config, train, cache)
    if dry_run:
        return _print_plan(api.status(task, upto, force or ()), as_json)
    with ProgressWatch() as watch:
        result = api.run(task, upto, forced=force or (), watch=watch, scheduler=scheduler, workers=workers)
    files = _export(result, output)
    if as_json:
        steps = console.step_rows(result.plan, result.made)
        console.print_json({"steps": steps, "metrics": result.metrics, "files": [str(file) for file in files]})
    else:
        _print_result(result, files)
    return None


@app.command()
def sweep(
    dataset: DatasetArgument = "motorcycle",
    thresholds: Annotated[str, typer.Option("--R", help="first:last:step, or numbers with commas.")] = "0.05:0.95:0.05",
    scene: SceneOption = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="section.field=value1,value2; all combinations are made.")
    ] = None,
    config: ConfigOption = None,
    train: TrainOption = False,
    output: Annotated[Path, typer.Option("--output", "-o", help="Where sweep.csv and sweep.png go.")] = Path("sweep"),
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Filter at many thresholds R, and over other settings.

    Says what was reused; --set section.field=value1,value2 tries several values of any setting.
    """
    from pipeline import api, console
    from pipeline.progress import ProgressWatch
    from pipeline.sweep_report import print_sweep, write_sweep

    task = _task(dataset, scene, None, config, train, cache)
    with ProgressWatch() as watch:
        result = api.sweep(task, thresholds, settings or (), watch=watch, scheduler=scheduler, workers=workers)
    files = write_sweep(result.metrics, output)
    if as_json:
        steps = console.step_rows(result.plan, result.made)
        console.print_json({"steps": steps, "metrics": result.metrics, "files": [str(file) for file in files]})
    else:
        print_sweep(result.metrics, api.mask_kinds(result))
        _say_files(files)
        print(console.reuse_line(result.made.values()))


@app.command()
def status(
    dataset: DatasetArgument = "motorcycle",
    upto: UptoOption = "metrics",
    scene: SceneOption = None,
    settings: SetOption = None,
    config: ConfigOption = None,
    train: TrainOption = False,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Say what is cached, and what changed if it is not."""
    from pipeline import api

    _print_plan(api.status(_task(dataset, scene, settings, config, train, cache), upto), as_json)


@app.command()
def explain(
    product: ProductArgument,
    dataset: DatasetArgument = "motorcycle",
    scene: SceneOption = None,
    settings: SetOption = None,
    config: ConfigOption = None,
    train: TrainOption = False,
    graph: Annotated[Path | None, typer.Option("--graph", help="Draw what it was made from (SVG, PNG, PDF).")] = None,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what a product's key is made of.

    Also why it would be made again, and what it was made from.
    """
    from pipeline import api
    from pipeline.explanation import draw_provenance, explanation, print_explanation

    planned = api.explain(_task(dataset, scene, settings, config, train, cache), product)
    found = explanation(planned, api.open_store(cache))
    if graph:
        draw_provenance(planned, api.open_store(cache), graph)
    if as_json:
        from pipeline.console import print_json

        print_json(found)
    else:
        print_explanation(found, graph)


@app.command()
def inspect(
    product: ProductArgument,
    dataset: DatasetArgument = "motorcycle",
    scene: SceneOption = None,
    png: Annotated[Path | None, typer.Option("--png", help="Draw the product into this file.")] = None,
    pixel: Annotated[str | None, typer.Option("--pixel", help="Y,X: whose cost curve to draw.")] = None,
    disparity: Annotated[int | None, typer.Option("--disparity", help="Which cost slice to draw, px.")] = None,
    settings: SetOption = None,
    config: ConfigOption = None,
    train: TrainOption = False,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show a cached product: its xarray, figures and picture.

    Also how to open it in Python. A map is drawn in terminals that can show it.
    """
    from pipeline import api
    from pipeline.inspect import draw, inspection, print_inspection

    planned = api.explain(_task(dataset, scene, settings, config, train, cache), product)
    found = inspection(planned, api.open_store(cache))
    if png:
        draw(found, png, pixel, disparity)
    print_inspection(found, png, as_json)


@data_app.command("list")
def data_list(
    dataset: Annotated[str | None, typer.Argument(help="List the scenes of this dataset.")] = None,
    as_json: JsonOption = False,
) -> None:
    """List the datasets there are, or the scenes of one."""
    from pipeline.datalist import list_datasets, list_scenes

    list_scenes(dataset, as_json) if dataset else list_datasets(as_json)


def _task(
    dataset: str,
    scenes: list[str] | None,
    settings: list[str] | None,
    config: Path | None,
    train: bool,
    cache: Path | None,
) -> "Task":
    from pipeline.api import Task

    return Task(dataset, tuple(scenes or ()), tuple(settings or ()), config, train, cache)


def _print_plan(plan: "Plan", as_json: bool) -> None:
    from pipeline import console

    if as_json:
        console.print_json({"steps": console.step_rows(plan, {}), "metrics": []})
    else:
        console.print_plan(plan)


def _print_result(result: "Result", files: list[Path]) -> None:
    from pipeline import api, console

    console.print_metrics(result.metrics, api.mask_kinds(result))
    console.print_notes(result.plan.notes)
    _say_files(files)
    print(console.reuse_line(result.made.values()))


def _say_files(files: list[Path]) -> None:
    for file in files:
        print(f"wrote {file}")


def _export(result: "Result", output: Path | None) -> list[Path]:
    if output is None:
        return []
    from pipeline.exporter import export

    return export(result, output)


for commands in (cli_match, cli_compare, cli_view):
    commands.register(app)


class _Stopped(BaseException):
    """SIGINT or SIGTERM arrived. Not KeyboardInterrupt: typer would wait for the tasks that still compute."""


def _stop(number: int, _: Any) -> None:  # noqa: ANN401
    raise _Stopped(number)


def main() -> None:
    """Run the command line; a user's mistake is one line and exit code 2."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)
    try:
        app(prog_name="pipeline")
    except _Stopped as stop:
        _leave(128 + int(stop.args[0]))
    except Exception as error:
        from pipeline.errors import USER_ERRORS

        if not isinstance(error, USER_ERRORS):
            raise
        print(f"pipeline: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _leave(code: int) -> None:
    """Exit at once: drafts are deleted by now, and tasks that still compute have nothing left to write to."""
    import os

    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
