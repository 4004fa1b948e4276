"""The commands that show: the report, the viewer over the cache.

Nothing heavy is imported before one of them runs.
"""

import sys
from pathlib import Path
from typing import Annotated

import typer

from semidense.pipeline.cli.options import (
    CacheOption,
    ConfigOption,
    DatasetArgument,
    JsonOption,
    ModeOption,
    PresetOption,
    SceneOption,
    SetOption,
    chosen,
    chosen_preset,
    config_file,
)


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command()(report)
    app.command()(view)


def report(
    dataset: DatasetArgument = "motorcycle",
    output: Annotated[Path, typer.Option("--output", "-o", help="The file to write.")] = Path("report.html"),
    scene: SceneOption = None,
    settings: SetOption = None,
    preset: PresetOption = None,
    mode: ModeOption = None,
    config: ConfigOption = None,
    train: Annotated[bool, typer.Option("--train", help="Report on a run that trained the networks.")] = False,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write all cached results of a dataset into one HTML file.

    Figures, curves, maps, training and settings; it loads nothing and makes nothing.
    """
    from semidense.pipeline.api import Task, status
    from semidense.pipeline.files.suggestion import run_command
    from semidense.pipeline.pages.report import report as write

    named = chosen_preset(preset, config)
    task = Task(dataset, tuple(scene or ()), chosen(settings, mode), config_file(config), train, cache, named)
    path = write(task, output)
    plan = status(task)
    if plan.todo():
        print(
            f"{len(plan.todo())} of {len(plan.steps)} products are not cached, and the page lacks them; make them with "
            f"`{run_command(task)}`",
            file=sys.stderr,
        )
    if as_json:
        from semidense.pipeline.cli.console import print_json

        print_json({"files": [str(path)], "bytes": path.stat().st_size})
        return
    typer.echo(f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB)")


def view(
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port of the page; 0 takes a free one.")] = 5006,
    show: Annotated[bool, typer.Option("--show/--no-show", help="Open the browser.")] = True,
    cache: CacheOption = None,
) -> None:
    """Open a page in the browser that shows the cache.

    Maps, confidence, threshold and cost curves together, on a page served to this machine alone.
    """
    from semidense.pipeline.pages.viewer import view as serve

    serve(cache, port=port, show=show)
