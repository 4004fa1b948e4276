"""The command that writes an archive for a benchmark's server. Nothing heavy is imported before it runs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
    WorkersOption,
    chosen,
    chosen_preset,
    config_file,
)

if TYPE_CHECKING:
    from semidense.datasets import SceneSource
    from semidense.pipeline.files.submissions.solved import Form, Solved
    from semidense.pipeline.results.result import Result

_PRODUCTS = {"dense": "filled", "sparse": "refined"}


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(submit)


def submit(
    benchmark: Annotated[str, typer.Argument(help="middlebury, kitti2015 or eth3d.")],
    dataset: DatasetArgument,
    output: Annotated[Path, typer.Option("--output", "-o", help="The archive to write.")] = Path("submission.zip"),
    method: Annotated[str, typer.Option("--method", help="Name of the method in the names of files.")] = "Semidense",
    form: Annotated[
        str | None,
        typer.Option(
            "--form",
            help="dense (holes filled) or sparse (only what is trusted) [default: both for middlebury, else sparse].",
        ),
    ] = None,
    partial: Annotated[
        bool, typer.Option("--partial", help="Write an archive that lacks scenes all the same.")
    ] = False,
    scene: SceneOption = None,
    settings: SetOption = None,
    preset: PresetOption = None,
    mode: ModeOption = None,
    config: ConfigOption = None,
    workers: WorkersOption = None,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write the archive that a benchmark's server takes.

    Makes the maps of all scenes, and checks the archive against the published rules.
    """
    from semidense.pipeline import api
    from semidense.pipeline.cli import console
    from semidense.pipeline.execution.progress import ProgressWatch
    from semidense.pipeline.files.submissions.archive import (
        forms_of,
        layout_of,
        require_complete,
        require_place,
        write_archive,
    )
    from semidense.pipeline.results.text import counted

    layout = layout_of(benchmark)
    forms = forms_of(layout, form)
    require_place(method, output)
    named = chosen_preset(preset, config)
    task = api.Task(dataset, tuple(scene or ()), chosen(settings, mode), config_file(config), False, cache, named)
    scenes = task.open().scenes
    lacks = require_complete(layout, scenes, partial)
    with ProgressWatch(console.announce) as watch:
        result = api.run(task, _PRODUCTS[forms[0]] if len(forms) == 1 else "filled", watch=watch, workers=workers)
    written = write_archive(layout, (_solved(result, each, forms) for each in scenes), method, output)
    if as_json:
        row = {"benchmark": benchmark, "archive": str(output), "scenes": len(scenes), "lacks": lacks}
        return console.print_json({**row, "files": written.files, "mean_seconds": written.seconds})
    if lacks:
        console.print_notes([f"{benchmark}: the server takes no archive {lacks}"])
    holds = f"{counted(len(scenes), 'scene')}, {counted(written.files, 'file')}"
    typer.echo(f"wrote {output}: {holds}, {written.seconds:.3g} s a scene")
    return None


def _solved(result: "Result", scene: "SceneSource", forms: "tuple[Form, ...]") -> "Solved":
    """Return the maps of a scene, and the seconds that what they were made from took."""
    import numpy as np

    from semidense.pipeline.files.submissions.solved import Solved
    from semidense.pipeline.results.provenance import lineage

    made = {form: result.find(_PRODUCTS[form], scene.name) for form in forms}
    maps = {form: np.asarray(result.store.arrays(each.key)["disparity"][...]) for form, each in made.items()}
    steps = {step.id for each in made.values() for step in lineage(result.made, each.step.id)}
    seconds = sum(result.made[step].seconds for step in steps if result.made[step].step.scene == scene.name)
    return Solved(scene, maps, seconds)
