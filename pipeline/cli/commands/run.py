"""The commands that make and describe products. Nothing heavy is imported before one runs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semidense.pipeline.cli.options import (
    CacheOption,
    ConfigOption,
    DatasetArgument,
    DryRunOption,
    ForceOption,
    JsonOption,
    ModeOption,
    OutputOption,
    PresetOption,
    ProductArgument,
    QuietOption,
    SceneOption,
    SchedulerOption,
    SetOption,
    TrainOption,
    UptoOption,
    VerboseOption,
    WorkersOption,
    chosen,
    chosen_preset,
    config_file,
)

if TYPE_CHECKING:
    from semidense.pipeline.api import Task
    from semidense.pipeline.results.result import Result


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    for command in (run, sweep, status, explain, inspect):
        app.command()(command)


def run(
    dataset: DatasetArgument = "motorcycle",
    upto: UptoOption = "metrics",
    scene: SceneOption = None,
    settings: SetOption = None,
    preset: PresetOption = None,
    mode: ModeOption = None,
    config: ConfigOption = None,
    train: TrainOption = False,
    dry_run: DryRunOption = False,
    force: ForceOption = None,
    output: OutputOption = None,
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    cache: CacheOption = None,
    verbose: VerboseOption = False,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Make the products of a dataset; what is cached is reused."""
    from semidense.pipeline import api
    from semidense.pipeline.cli import console
    from semidense.pipeline.execution.progress import ProgressWatch
    from semidense.pipeline.execution.scheduler import threads_of
    from semidense.pipeline.files.run_files import require_run_place

    task = _task(dataset, scene, chosen(settings, mode), config, train, cache, preset)
    if dry_run:
        plan = api.status(task, upto, forced=force or ())
        return console.show_plan(plan, api.open_store(cache), as_json, threads_of(scheduler, workers))
    if output:
        require_run_place(output, upto)
    with ProgressWatch(console.announce, verbose - quiet) as watch:
        result = api.run(task, upto, forced=force or (), watch=watch, scheduler=scheduler, workers=workers)
    files = _export(result, output)
    if as_json:
        steps = console.step_rows(result.plan, result.made)
        console.print_json({"steps": steps, "metrics": result.metrics, "files": [str(file) for file in files]})
    else:
        _print_result(result, files)
    return None


def sweep(
    dataset: DatasetArgument = "motorcycle",
    thresholds: Annotated[
        str | None,
        typer.Option(
            "--R",
            help="Confidence thresholds: first:last:step, or numbers with commas [default: 0.05:0.95:0.05; none where "
            "semidense.density or semidense.max_error decides].",
        ),
    ] = None,
    scene: SceneOption = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="Try several values of a setting: section.field=value1,value2; repeat the option for other settings: "
            "all combinations are made.",
        ),
    ] = None,
    preset: PresetOption = None,
    mode: ModeOption = None,
    config: ConfigOption = None,
    train: TrainOption = False,
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", help="Write sweep.csv and sweep.json to this folder; also sweep.png, where R decides."
        ),
    ] = Path("sweep"),
    dry_run: DryRunOption = False,
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    cache: CacheOption = None,
    verbose: VerboseOption = False,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Compare error and density at many thresholds R.

    --set section.field=value1,value2 tries several values of any setting.
    """
    from semidense.pipeline import api
    from semidense.pipeline.cli import console
    from semidense.pipeline.execution.progress import ProgressWatch
    from semidense.pipeline.execution.scheduler import threads_of
    from semidense.pipeline.files.run_files import require_sweep_place, write_sweep

    task = _task(dataset, scene, chosen(None, mode), config, train, cache, preset)
    if dry_run:
        request = api.sweep_request(task, thresholds, settings or ())
        plan = api.planned(task, request)
        return console.show_plan(plan, api.open_store(cache), as_json, threads_of(scheduler, workers))
    require_sweep_place(output)
    with ProgressWatch(console.announce, verbose - quiet) as watch:
        result = api.sweep(task, thresholds, settings or (), watch=watch, scheduler=scheduler, workers=workers)
    files = write_sweep(result.metrics, output)
    if as_json:
        steps = console.step_rows(result.plan, result.made)
        console.print_json({"steps": steps, "metrics": result.metrics, "files": [str(file) for file in files]})
    else:
        console.print_sweep(result.metrics, result.mask_kinds())
        by_R = any("R" in row for row in result.metrics)
        console.print_notes([*result.plan.notes, *([] if by_R else ["no sweep.png: R does not decide here"])])
        _say_files(files)
        print(console.reuse_line(result.made.values()))
    return None


def status(
    dataset: DatasetArgument = "motorcycle",
    upto: UptoOption = "metrics",
    scene: SceneOption = None,
    settings: SetOption = None,
    preset: PresetOption = None,
    mode: ModeOption = None,
    config: ConfigOption = None,
    train: TrainOption = False,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print which products are cached, and why the others must be made."""
    from semidense.pipeline import api
    from semidense.pipeline.cli import console

    plan = api.status(_task(dataset, scene, chosen(settings, mode), config, train, cache, preset), upto)
    console.show_plan(plan, api.open_store(cache), as_json)


def explain(
    product: ProductArgument,
    dataset: DatasetArgument = "motorcycle",
    scene: SceneOption = None,
    settings: SetOption = None,
    preset: PresetOption = None,
    mode: ModeOption = None,
    config: ConfigOption = None,
    train: TrainOption = False,
    graph: Annotated[
        Path | None,
        typer.Option("--graph", help="Draw what the product was made from into this file (SVG, PNG or PDF)."),
    ] = None,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what a product's cache key is made of.

    Also shows why the product would be made again, and from what it was made.
    """
    from semidense.pipeline import api
    from semidense.pipeline.cli.commands.explain import draw_provenance, explanation, print_explanation
    from semidense.pipeline.plan.config import preset_settings

    task = _task(dataset, scene, chosen(settings, mode), config, train, cache, preset)
    planned = api.explain(task, product)
    found = explanation(planned, api.open_store(cache))
    found |= {"preset": {"name": task.preset, "settings": list(preset_settings(task.preset))}}
    if graph:
        draw_provenance(planned, api.open_store(cache), graph, task)
    if as_json:
        from semidense.pipeline.cli.console import print_json

        print_json(found)
    else:
        print_explanation(found, graph)


def inspect(
    product: ProductArgument,
    dataset: DatasetArgument = "motorcycle",
    scene: SceneOption = None,
    png: Annotated[Path | None, typer.Option("--png", help="Draw the product into this file.")] = None,
    pixel: Annotated[
        str | None, typer.Option("--pixel", help="With --png: draw the cost curve of this pixel: Y,X.")
    ] = None,
    disparity: Annotated[
        int | None, typer.Option("--disparity", help="With --png: draw the slice of costs at this disparity, px.")
    ] = None,
    settings: SetOption = None,
    preset: PresetOption = None,
    mode: ModeOption = None,
    config: ConfigOption = None,
    train: TrainOption = False,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show a cached product: its arrays, statistics and picture.

    Also shows how to open it in Python. Terminals with colours show a map at once.
    """
    from semidense.pipeline import api
    from semidense.pipeline.cli.commands.inspect import draw, inspection, print_inspection
    from semidense.pipeline.plan.errors import UsageError

    if png is None and (pixel is not None or disparity is not None):
        raise UsageError("--pixel and --disparity choose what is drawn into --png: add --png FILE")
    task = _task(dataset, scene, chosen(settings, mode), config, train, cache, preset)
    planned = api.explain(task, product)
    found = inspection(planned, api.open_store(cache), task)
    if png:
        draw(found, png, pixel, disparity)
    print_inspection(found, png, as_json)


def _task(
    dataset: str,
    scenes: list[str] | None,
    settings: tuple[str, ...],
    config: Path | None,
    train: bool,
    cache: str | None,
    preset: str | None,
) -> "Task":
    from semidense.pipeline.api import Task

    chosen = chosen_preset(preset, config)
    return Task(dataset, tuple(scenes or ()), settings, config_file(config), train, cache, chosen)


def _print_result(result: "Result", files: list[Path]) -> None:
    from semidense.pipeline.cli import console

    console.print_metrics(result.metrics, result.mask_kinds())
    console.print_notes(result.plan.notes)
    _say_files(files)
    print(console.reuse_line(result.made.values()))


def _say_files(files: list[Path]) -> None:
    for file in files:
        print(f"wrote {file}")


def _export(result: "Result", output: Path | None) -> list[Path]:
    if output is None:
        return []
    from semidense.pipeline.files.run_files import export

    return export(result, output)
