"""The arguments and options that several commands take, each said once."""

import os
from pathlib import Path
from typing import Annotated

import typer

DatasetArgument = Annotated[str, typer.Argument(help="Such as motorcycle or middlebury:DIR; see `pipeline data list`.")]
SceneOption = Annotated[list[str] | None, typer.Option("--scene", help="Only this scene; may be repeated.")]
SetOption = Annotated[list[str] | None, typer.Option("--set", help="section.field=value; may be repeated.")]
PresetOption = Annotated[
    str,
    typer.Option(
        "--preset",
        help="Settings to start from: paper, or robust: fewer wrong pixels where texture is thin.",
    ),
]
ModeOption = Annotated[
    str | None,
    typer.Option(
        "--mode",
        help="How costs are computed: exact, guided (fewer disparities, same networks) or fast (a smaller network); "
        "the same as --set costvolume.mode=...",
    ),
]
ConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config",
        help="Settings from a TOML file, or from a config.json that --output wrote [default: $PIPELINE_CONFIG, else "
        "./pipeline.toml if there is one].",
    ),
]
CacheOption = Annotated[
    Path | None, typer.Option("--cache", help="The cache's folder [default: $PIPELINE_CACHE, else the user's].")
]
TrainOption = Annotated[bool, typer.Option("--train", help="Train the networks; the shipped weights are not used.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object, and nothing else, on stdout.")]
OutputOption = Annotated[
    Path | None, typer.Option("--output", "-o", help="Write maps, metrics and configuration to this folder.")
]
SchedulerOption = Annotated[
    str | None, typer.Option("--scheduler", help="A Dask scheduler, tcp://HOST:PORT; the cache must be shared.")
]
WorkersOption = Annotated[int | None, typer.Option("--workers", min=1, help="Threads [default: one a core].")]
UptoOption = Annotated[str, typer.Option("--upto", help="The product to stop at.")]
ForceOption = Annotated[
    list[str] | None, typer.Option("--force", help="Make this product again, and compare; may be repeated.")
]
DryRunOption = Annotated[bool, typer.Option("--dry-run", help="Only say what would be reused and made.")]
ProductArgument = Annotated[str, typer.Argument(help="Such as costvolume, disparity or confidence.")]


def chosen(settings: list[str] | None, mode: str | None) -> tuple[str, ...]:
    """Return the settings that ``--set`` and ``--mode`` give; ``--mode`` wins."""
    return (*(settings or ()), *([f"costvolume.mode={mode}"] if mode else []))


def config_file(config: Path | None) -> Path | None:
    """Return the file of settings: ``--config``, else ``$PIPELINE_CONFIG``, else ``./pipeline.toml`` if it is there."""
    named = os.environ.get("PIPELINE_CONFIG")
    beside = Path("pipeline.toml")
    return config or (Path(named).expanduser() if named else beside if beside.is_file() else None)
