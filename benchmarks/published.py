"""The figures that a benchmark's own tables would have of our maps: ``python -m benchmarks.published NAME DATASET``.

Makes the maps that ``pipeline submit`` would send, and judges those whose truth is known by the benchmark's own rules:
what a share is of, how gaps count, how the mean is taken. Middlebury's and ETH3D's figures are of the pixels that both
views see.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray
from rich.table import Column, Table

from benchmarks.harness import as_command, write
from semidense.datasets import SceneSource
from semidense.datasets.scene import Truth
from semidense.pipeline.api import Task, run
from semidense.pipeline.files.submissions.middlebury import place
from semidense.pipeline.plan.errors import UsageError, nearest
from semidense.pipeline.results.text import print_table, results
from semidense.stages.metrics.eth3d import eth3d_figures
from semidense.stages.metrics.kitti import d1_counts, d1_figures, kitti2012_figures
from semidense.stages.metrics.middlebury import FULL_SIZE, middlebury_figures, weighted_mean

PRODUCTS = {"sparse": "refined", "dense": "filled"}
"""The product that is judged, by the form that is submitted."""
Figures = Mapping[str, float]


class Judged(NamedTuple):
    """A scene, its truth, and our map: (y, x) float32, px, NaN where nothing is reported."""

    source: SceneSource
    truth: Truth
    disparity: NDArray[np.float32]


def middlebury(judged: Sequence[Judged]) -> Figures:
    """Return the figures of MiddEval3: hard scenes count half in the mean."""
    return weighted_mean({"/".join(place(each.source)): _middlebury(each) for each in judged})


def _middlebury(each: Judged) -> dict[str, float]:
    unit, largest = FULL_SIZE[place(each.source)[0][-1]], each.source.disparities.maximum
    return middlebury_figures(each.disparity, each.truth.disparity, each.truth.nonocc, largest, unit)


def kitti2012(judged: Sequence[Judged]) -> Figures:
    """Return the figures of KITTI 2012: gaps are filled, and the mean is over frames."""
    return _mean([kitti2012_figures(each.disparity, each.truth.disparity) for each in judged])


def kitti2015(judged: Sequence[Judged]) -> Figures:
    """Return the figures of KITTI 2015: gaps are filled, and the pixels of all frames count together.

    All pixels are taken for background, since a copy has no mask of the moving cars.
    """
    figures = d1_figures(sum((d1_counts(each.disparity, each.truth.disparity) for each in judged), np.int64(0)))
    return {name: figures[name] for name in ("D1-all", "D1-est", "density")}


def eth3d(judged: Sequence[Judged]) -> Figures:
    """Return the figures of ETH3D: shares of the reported pixels, and the mean over scenes."""
    return _mean([eth3d_figures(each.disparity, each.truth.disparity, each.truth.nonocc) for each in judged])


def _mean(rows: Sequence[Figures]) -> dict[str, float]:
    return {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}


RULES: Mapping[str, Callable[[Sequence[Judged]], Figures]] = {
    rule.__name__: rule for rule in (middlebury, kitti2012, kitti2015, eth3d)
}
"""How each benchmark judges scenes."""


def main(
    benchmark: Annotated[str, typer.Argument(help=f"by whose rules: {', '.join(RULES)}")],
    dataset: Annotated[str, typer.Argument(help="its scenes, such as eth3d:DIR; those without a truth are left out")],
    form: Annotated[str, typer.Option(help="sparse: what is trusted; dense: holes filled")] = "sparse",
    preset: Annotated[str, typer.Option(help="named settings")] = "robust",
    setting: Annotated[list[str] | None, typer.Option("--set", help="section.field=value")] = None,
    cache: Annotated[Path | None, typer.Option(help="the cache's folder; default: the user's")] = None,
) -> None:
    """Print and write the figures."""
    for name, known in ((benchmark, RULES), (form, PRODUCTS)):
        if name not in known:
            raise UsageError(f"{name!r} is not known; {nearest(name, known)}")
    judged = _judged(Task(dataset, settings=setting or (), preset=preset, cache=cache), PRODUCTS[form])
    figures = RULES[benchmark](judged)
    write("published", {"benchmark": benchmark, "form": form, "scenes": len(judged), "figures": dict(figures)})
    table = Table(*(Column(name, justify="right") for name in ("scenes", *figures)), box=None)
    table.add_row(str(len(judged)), *(f"{value:.2f}" for value in figures.values()))
    print_table(table, results())


def _judged(task: Task, product: str) -> list[Judged]:
    """Make the maps of a task, and return those of scenes whose truth is known."""
    known = [(source, truth) for source in task.open().scenes if (truth := source.load_truth()) is not None]
    if not known:
        raise UsageError(f"{task.dataset}: no scene has a truth, so no figure can be worked out")
    found = run(task, product)
    return [Judged(source, truth, found.open(product, source.name)["disparity"].values) for source, truth in known]


if __name__ == "__main__":
    as_command(main)
