"""The `data` commands. Like `semidense.pipeline.cli.main`: nothing heavy is imported before a command runs."""

import os
from pathlib import Path
from typing import Annotated

import typer

from semidense.pipeline.cli.options import DatasetArgument, JsonOption, SceneOption

data_app = typer.Typer(help="List, fetch and check datasets.", no_args_is_help=True)

DataOption = Annotated[
    Path | None, typer.Option("--data", help="Folder of all fetched data [default: $STEREO_DATA, else ./data].")
]


def data_folder(data: Path | None) -> Path:
    """Return the folder of all fetched data: ``--data``, else ``$STEREO_DATA``, else ``./data``."""
    return data or Path(os.environ.get("STEREO_DATA") or "data").expanduser()


@data_app.command("list")
def data_list(
    dataset: Annotated[str | None, typer.Argument(help="List the scenes of this dataset.")] = None,
    data: DataOption = None,
    as_json: JsonOption = False,
) -> None:
    """List the known datasets, or the scenes of one.

    Below the datasets is what can be fetched: how large it is, its licence, what to cite, and whether it is here.
    """
    from semidense.pipeline.cli.commands.data.listing import list_datasets, list_scenes

    list_scenes(dataset, as_json) if dataset else list_datasets(data_folder(data), as_json)


@data_app.command("fetch")
def data_fetch(
    name: Annotated[str, typer.Argument(help="What to fetch, such as middeval3-q; `pipeline data list` names all.")],
    data: DataOption = None,
    origin: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="ADDRESS|DIR",
            help="Take the files from a mirror or a folder that has them under the paths of the publisher's addresses.",
        ),
    ] = None,
    lock: Annotated[
        Path | None,
        typer.Option("--lock", help="File of checksums to compare with and to add to [default: fetched.lock in DIR]."),
    ] = None,
    again: Annotated[bool, typer.Option("--again", help="Fetch it even if it is here.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Fetch a benchmark from its publisher.

    An interrupted fetch goes on where it stopped. The checksum of each file is recorded when it is first fetched; a
    file that differs from it later is refused.
    """
    from semidense.pipeline.cli.commands.data.fetching import fetch

    folder = data_folder(data)
    fetch(name, folder, lock or folder / "fetched.lock", origin, again, as_json)


@data_app.command("check")
def data_check(dataset: DatasetArgument, scene: SceneOption = None, as_json: JsonOption = False) -> None:
    """Check that a copy of a dataset is sound.

    Loads every scene, and checks sizes and ranges, and by correlation that the ground truth has the scale and the
    direction of its images. The exit code is 1 if something is wrong.
    """
    from semidense.pipeline.cli.commands.data.checking import check

    if not check(dataset, scene or (), as_json):
        raise typer.Exit(1)


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.add_typer(data_app, name="data")
