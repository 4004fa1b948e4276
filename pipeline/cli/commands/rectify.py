"""The command ``rectify``. Nothing heavy is imported before it runs."""

from pathlib import Path
from typing import Annotated

import typer

from semidense.pipeline.cli.options import JsonOption


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(rectify)


def rectify(
    left: Annotated[Path, typer.Argument(help="The left view, as the camera took it.")],
    right: Annotated[Path, typer.Argument(help="The right view.")],
    calib: Annotated[
        list[Path],
        typer.Option(
            help="OpenCV's stereo calibration with M1 D1 M2 D2 and R T, or R1 R2 P1 P2; repeat the option if it is in "
            "two files."
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Write both views and their calibration to this folder.")
    ] = Path("rectified"),
    unit: Annotated[
        str | None, typer.Option(help="Unit of the calibration's lengths: mm, cm or m; match needs it for depth.")
    ] = None,
    alpha: Annotated[
        float,
        typer.Option(min=0, max=1, help="0: crop to what both lenses saw; 1: keep every pixel, with black edges."),
    ] = 0.0,
    as_json: JsonOption = False,
) -> None:
    """Rectify a pair, so that match can take it.

    Needs OpenCV and a stereo calibration that was made with OpenCV.
    """
    from semidense.pipeline.cli.console import print_json
    from semidense.pipeline.pairs.rectification import rectify_files

    files = rectify_files(left, right, calib, output, unit, alpha)
    if as_json:
        print_json({"files": [str(file) for file in files]})
        return
    for file in files:
        typer.echo(f"wrote {file}")
    told = "" if unit else " --unit UNIT"
    typer.echo(f"next: pipeline match {files[0]} {files[1]} --calib {files[2]}{told} -o DIR")
