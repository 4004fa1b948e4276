"""Where each second of a run goes, by Dask's own profilers: ``python -m benchmarks.timeline``.

Runs a scene in an empty cache, prints the seconds of each product, and draws which worker did what and when, above
the load of the processor and the memory of the process.
"""

import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from dask.diagnostics import Profiler, ResourceProfiler
from rich.console import Console
from rich.table import Table

from benchmarks.harness import timed, write
from semidense.pipeline.api import Task, run
from semidense.pipeline.plan.steps import products

PICTURE = Path("docs/pictures/timeline.png")
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
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    start = min(each.start_time for each in results)
    workers = {name: row for row, name in enumerate(sorted({each.worker_id for each in results}))}
    heights = {"height_ratios": (2, 1, 1)}
    figure, axes = plt.subplots(3, 1, figsize=(9, 5), sharex=True, layout="constrained", gridspec_kw=heights)
    upper = axes[0]
    for index, product in enumerate(dict.fromkeys(product_of(each.key) for each in results)):
        own = [each for each in results if product_of(each.key) == product]
        upper.barh(
            [workers[each.worker_id] for each in own],
            [each.end_time - each.start_time for each in own],
            left=[each.start_time - start for each in own],
            color=f"C{index}",
            label=product,
            edgecolor="white",
            linewidth=0.3,
        )
    upper.set(yticks=range(len(workers)), yticklabels=[f"worker {row + 1}" for row in workers.values()], title=dataset)
    upper.legend(loc="upper left", bbox_to_anchor=(1, 1), fontsize="small")
    times = [each.time - start for each in resources]
    for lower, values, unit in (
        (axes[1], [each.cpu for each in resources], "processor, %"),
        (axes[2], [each.mem for each in resources], "memory, MB"),
    ):
        lower.plot(times, values)
        lower.set(ylabel=unit, ylim=(0, None))
    axes[2].set(xlabel="seconds")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    typer.run(main)
