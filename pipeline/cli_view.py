"""The commands that show: the report, and the viewer over the cache."""

from pathlib import Path
from typing import Annotated

import typer

from pipeline.cli_options import CacheOption, ConfigOption, DatasetArgument, SceneOption, SetOption


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command()(report)
    app.command()(view)


def report(
    dataset: DatasetArgument = "motorcycle",
    output: Annotated[Path, typer.Option("--output", "-o", help="The file to write.")] = Path("report.html"),
    scene: SceneOption = None,
    settings: SetOption = None,
    config: ConfigOption = None,
    train: Annotated[bool, typer.Option("--train", help="Of a run that trained the networks.")] = False,
    cache: CacheOption = None,
) -> None:
    """Write one HTML file of all that is cached of a dataset.

    Figures, curves, maps, training and settings; it loads nothing and makes nothing.
    """
    from pipeline.api import Task
    from pipeline.reporting import report as write

    path = write(Task(dataset, tuple(scene or ()), tuple(settings or ()), config, train, cache), output)
    typer.echo(f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB)")


def view(
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="0: any that is free.")] = 5006,
    show: Annotated[bool, typer.Option("--show/--no-show", help="Open the browser.")] = True,
    cache: CacheOption = None,
) -> None:
    """Look into the cache in the browser.

    Maps, confidence, threshold and cost curves together, on a page served to this machine alone.
    """
    from pipeline.viewer import view as serve

    serve(cache, port=port, show=show)
