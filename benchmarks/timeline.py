"""Where each second of a run goes, by Dask's own profilers: ``python -m benchmarks.timeline``.

Runs a scene in an empty cache, prints the seconds of each product, and draws which worker did what and when, above
the load of the processor and the memory of the process.
"""

import tempfile
from collections import defaultdict
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Annotated, Any

import typer
from dask.diagnostics import Profiler, ResourceProfiler
from matplotlib.axes import Axes
from rich.console import Console
from rich.table import Table

from benchmarks.harness import as_command, timed, write
from semidense.pipeline.api import Task, run
from semidense.pipeline.figures.colours import BLUE, LINES
from semidense.pipeline.figures.drawing import legend_below, new_figure
from semidense.pipeline.plan.steps import products

PICTURE = Path("docs/pictures/timeline.png")
HATCHES = ("", "//", "..")
"""Patterns that tell products of the same colour apart."""
SCENE = "synthetic:train=0,test=1,height=240,width=320,disparities=24"


def product_of(key: str) -> str:
    """Return the product that a task of this key works for."""
    return key.split("-", 1)[0]


def main(
    dataset: Annotated[str, typer.Argument(help="such as motorcycle")] = SCENE,
    picture: Annotated[Path, typer.Option()] = PICTURE,
) -> None:
    """Print and draw."""
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
        Profiler() as tasks,
        ResourceProfiler(dt=0.25) as machine,
    ):
        whole = timed(lambda: run(Task(dataset, cache=Path(folder))))
    rows = _seconds(tasks.results)
    busy = sum(seconds for _, seconds in rows.values())
    table = Table("product", "tasks", "seconds", "% of the work", box=None)
    for name, (count, seconds) in rows.items():
        table.add_row(name, str(count), f"{seconds:.2f}", f"{100 * seconds / busy:.1f}")
    Console(width=100).print(table)
    workers = len({each.worker_id for each in tasks.results})
    print(f"{whole:.1f} s in all; {workers} workers were busy {100 * busy / workers / whole:.0f} % of it")
    write("timeline", {"dataset": dataset, "seconds": whole, "products": rows})
    _draw(tasks.results, machine.results, dataset, picture)


def _seconds(results: Sequence[Any]) -> dict[str, tuple[int, float]]:
    """Return the number of tasks and their seconds by product, in the order of the dataflow."""
    found: dict[str, list[float]] = defaultdict(list)
    for each in results:
        found[product_of(each.key)].append(each.end_time - each.start_time)
    return {name: (len(found[name]), sum(found[name])) for name in products() if name in found}


def _draw(results: Sequence[Any], resources: Sequence[Any], dataset: str, path: Path) -> None:
    start = min(each.start_time for each in results)
    figure = new_figure(f"{dataset}: which worker did what and when")
    figure.set_size_inches(8, 6.6)
    axes = figure.subplots(3, 1, sharex=True, height_ratios=(2, 1.5, 1.5))
    _draw_tasks(axes[0], results, start)
    times = [each.time - start for each in resources]
    _draw_load(axes[1], times, [each.cpu for each in resources], "load (%)")
    _draw_load(axes[2], times, [each.mem for each in resources], "memory (MB)")
    axes[2].set(xlabel="time (s)")
    legend_below(figure, axes[0].get_legend_handles_labels()[0])
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def _draw_tasks(axes: Axes, results: Sequence[Any], start: float) -> None:
    """Draw a bar a task in the row of its worker, in the colour and hatching of its product."""
    workers = {name: row for row, name in enumerate(sorted({each.worker_id for each in results}))}
    styles = cycle([(colour, hatch) for hatch in HATCHES for colour in LINES])
    made = dict.fromkeys(product_of(each.key) for each in results)
    for product, (colour, hatch) in zip(made, styles, strict=False):
        own = [each for each in results if product_of(each.key) == product]
        axes.barh(
            [workers[each.worker_id] for each in own],
            [each.end_time - each.start_time for each in own],
            left=[each.start_time - start for each in own],
            color=colour,
            hatch=hatch,
            label=product,
            edgecolor="white",
            linewidth=0.3,
        )
    names = [f"worker {row + 1}" for row in workers.values()]
    axes.set_yticks(range(len(workers)), names)


def _draw_load(axes: Axes, times: Sequence[float], values: Sequence[float], label: str) -> None:
    axes.plot(times, values, color=BLUE)
    axes.set(ylabel=label, ylim=(0, None))
    axes.grid(alpha=0.3)


if __name__ == "__main__":
    as_command(main)
