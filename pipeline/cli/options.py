"""The arguments and options that several commands take, each said once."""

import json
import os
from pathlib import Path
from typing import Annotated

import typer

from semidense.pipeline.plan.presets import DEFAULT

DatasetArgument = Annotated[
    str, typer.Argument(help="Scenes to work on, such as motorcycle or middlebury:DIR; `pipeline data list` names all.")
]
SceneOption = Annotated[
    list[str] | None, typer.Option("--scene", help="Work on this scene only; repeat the option for several.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", help="Change a setting: section.field=value; repeat the option for several."),
]
PresetOption = Annotated[
    str | None,
    typer.Option(
        "--preset",
        help="Settings to start from: paper (the method of the paper), robust (fewer wrong pixels where texture is "
        "thin) or foreign (confidence of maps that another matcher made) [default: that of a config.json; else robust "
        "for match, paper for others].",
    ),
]
ModeOption = Annotated[
    str | None,
    typer.Option(
        "--mode",
        help="How costs are computed: exact, guided (only proposed disparities) or fast (products of descriptors); "
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


def _lasting(cache: str | None) -> str | None:
    """Refuse a cache that would end with the command."""
    if cache and cache.startswith("memory:"):
        raise typer.BadParameter(f"{cache} ends with the command; name a folder or an object store")
    return cache


CacheOption = Annotated[
    str | None,  # a path would lose one of a URL's slashes
    typer.Option(
        "--cache",
        callback=_lasting,
        metavar="FOLDER|URL",
        help="Folder of the cache, or a URL: s3://, gs:// or az:// [default: $PIPELINE_CACHE, else your user cache "
        "folder].",
    ),
]
TrainOption = Annotated[
    bool, typer.Option("--train", help="Train the networks instead of using the weights that come with the package.")
]
VerboseOption = Annotated[
    bool, typer.Option("--verbose", "-v", help="Name every product that is made, not only the slow ones.")
]
QuietOption = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print results and warnings only: no progress, no estimate of the time.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object on stdout.")]
OutputOption = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        help="Write maps, metrics and configuration to this folder; maps of other scenes stay.",
    ),
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        help="Compute on a Dask cluster: tcp://HOST:PORT, a scheduler file, processes:N for N processes of this "
        "machine, or env for $DASK_SCHEDULER_ADDRESS. Its workers must see the same cache.",
    ),
]
WorkersOption = Annotated[
    int | None,
    typer.Option("--workers", min=1, help="Number of threads [default: one for each core]; not with --scheduler."),
]
UptoOption = Annotated[str, typer.Option("--upto", help="Make products up to this one.")]
ForceOption = Annotated[
    list[str] | None,
    typer.Option(
        "--force", help="Make this product again and check that it comes out the same; repeat the option for several."
    ),
]
DryRunOption = Annotated[
    bool,
    typer.Option("--dry-run", help="Print what would be reused, and what would be made in what time; make nothing."),
]
FormatOption = Annotated[str, typer.Option("--format", help="Formats of the maps, with commas.")]
UnitOption = Annotated[
    str | None, typer.Option(help="Unit of length in the calibration, if the file does not say: mm, cm or m.")
]
CalibOption = Annotated[
    list[str] | None,
    typer.Option(
        help="Calibration file (Middlebury, OpenCV, KITTI, JSON, ...), for depth; of ROS both files, left first."
    ),
]
ThresholdOption = Annotated[
    float | None, typer.Option("--R", help="Keep disparities of at least this confidence, 0 to 1 [default: 0.9].")
]
DensityOption = Annotated[
    str | None,
    typer.Option(help="Instead of --R: keep the most confident pixels, this share of the image, such as 80%."),
]
MaxErrorOption = Annotated[
    str | None,
    typer.Option(
        "--max-error",
        help="Instead of --R: keep as many pixels as this share of errors allows, such as 2%. `match` needs a "
        "calibration for it, which the presets have; `score` needs none.",
    ),
]
ProductArgument = Annotated[str, typer.Argument(help="A product, such as costvolume, disparity or confidence.")]


def chosen(settings: list[str] | None, mode: str | None) -> tuple[str, ...]:
    """Return the settings that ``--set`` and ``--mode`` give; ``--mode`` wins."""
    return (*(settings or ()), *([f"costvolume.mode={mode}"] if mode else []))


def config_file(config: Path | None) -> Path | None:
    """Return the file of settings: ``--config``, else ``$PIPELINE_CONFIG``, else ``./pipeline.toml`` if it is there."""
    if config or not (named := os.environ.get("PIPELINE_CONFIG")):
        beside = Path("pipeline.toml")
        return config or (beside if beside.is_file() else None)
    from semidense.datasets.formats.files import user_path

    return user_path(named)


def chosen_preset(preset: str | None, config: Path | None, default: str = DEFAULT) -> str:
    """Return ``--preset``, else the preset of the run that wrote the file of settings, else the command's default."""
    file = config_file(config)
    return preset or (file and _recorded_preset(file)) or default


def _recorded_preset(file: Path) -> str | None:
    """Return the preset in a ``config.json``; None if there is none, also in a file that will be refused later."""
    try:
        plain = file.suffix == ".json" and file.is_file()  # a pipe would keep us waiting
        found = json.loads(file.read_text())["preset"] if plain else None
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return None
    return found if isinstance(found, str) else None


_EXAMPLES = {"density": "80% or 0.8", "max-error": "2% or 0.02"}
"""Shares as they are typed, by option."""


def share(name: str, text: str | None) -> float | None:
    """Return what ``80%`` or ``0.8`` means.

    Raises:
        UsageError: if it is no share above 0 and up to 1.
    """
    if text is None:
        return None
    from semidense.pipeline.plan.errors import UsageError

    try:
        value = float(text[:-1]) / 100 if text.endswith("%") else float(text)
    except ValueError:
        value = float("nan")
    if not 0 < value <= 1:
        raise UsageError(f"{name} {text!r}: write a share of the pixels, such as {_EXAMPLES[name]}")
    return value


def map_formats(text: str) -> list[str]:
    """Return the formats of maps that a text with commas names.

    Raises:
        UsageError: if there is no such format; the nearest is given.
    """
    from semidense.pipeline.files.map_files import FORMATS
    from semidense.pipeline.plan.errors import UsageError, nearest

    chosen = list(dict.fromkeys(kind.strip() for kind in text.split(",") if kind.strip()))
    for kind in chosen:
        if kind not in FORMATS:
            raise UsageError(f"no format {kind!r}; {nearest(kind, FORMATS)}")
    return chosen
