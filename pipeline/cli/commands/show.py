"""The commands that show: the report, the viewer over the cache, the datasets.

Nothing heavy is imported before one of them runs.
"""

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
    data = typer.Typer(help="Look at datasets.", no_args_is_help=True)
    data.command("list")(data_list)
    app.add_typer(data, name="data")


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
    from semidense.pipeline.api import Task
    from semidense.pipeline.pages.report import report as write

    named = chosen_preset(preset, config)
    task = Task(dataset, tuple(scene or ()), chosen(settings, mode), config_file(config), train, cache, named)
    path = write(task, output)
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


def data_list(
    dataset: Annotated[str | None, typer.Argument(help="List the scenes of this dataset.")] = None,
    as_json: JsonOption = False,
) -> None:
    """List the known datasets, or the scenes of one."""
    list_scenes(dataset, as_json) if dataset else list_datasets(as_json)


def list_datasets(as_json: bool) -> None:
    """Print what DATASET can be."""
    from rich.table import Table

    from semidense.datasets import describe
    from semidense.pipeline.cli.console import print_json
    from semidense.pipeline.results.text import results

    rows = describe()
    if as_json:
        print_json({"datasets": [{"dataset": pattern, "about": about} for pattern, about in rows]})
        return
    table = Table("dataset", "what it is", box=None)
    for pattern, about in rows:
        table.add_row(pattern, about)
    results().print(table)


def list_scenes(dataset: str, as_json: bool) -> None:
    """Print the scenes of a dataset: size, disparities, split, whether there is a truth.

    Raises:
        DatasetError: if the dataset cannot be read.
    """
    from rich.markup import escape
    from rich.table import Table

    from semidense.datasets import open_dataset
    from semidense.pipeline.cli.console import print_json
    from semidense.pipeline.results.text import results

    scenes = open_dataset(dataset).scenes
    if as_json:
        rows = [
            {
                "scene": scene.name,
                "rows": scene.size[0],
                "columns": scene.size[1],
                "d_min": scene.disparities.minimum,
                "d_max": scene.disparities.maximum,
                "split": scene.split,
                "truth": scene.has_truth,
            }
            for scene in scenes
        ]
        print_json({"dataset": dataset, "scenes": rows})
        return
    table = Table("scene", "rows x columns", "disparities px", "split", "truth", box=None)
    for scene in scenes:
        size, bounds = f"{scene.size[0]} x {scene.size[1]}", f"{scene.disparities.minimum}..{scene.disparities.maximum}"
        table.add_row(escape(scene.name), size, bounds, scene.split, "yes" if scene.has_truth else "no")
    results().print(table)
