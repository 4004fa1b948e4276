"""Full-size MiddEval3 on many workers, simulated: ``python -m benchmarks.simulation DIR/MiddEval3/trainingQ``.

What is simulated is the very graph of tasks that a cluster is given. Each task takes what it took on one thread of this
machine for two synthetic scenes: a fixed part, and one in proportion to the pixels, or to the cells of a volume. A free
worker takes the ready task that Dask's own order puts first. The scheduler handles one task at a time, in seconds that
are measured here with tasks that do nothing. The store and the network take as long as this machine's disk.
"""

import heapq
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from dask.diagnostics import Profiler
from rich.console import Console

from benchmarks.harness import as_command, timed, write
from semidense.datasets import open_dataset
from semidense.pipeline.api import Task, run, status
from semidense.pipeline.execution.graph import make_graph
from semidense.pipeline.plan.plan import Plan

MEASURED = ((96, 128, 16), (192, 256, 32))
"""Rows, columns and disparities of the two scenes that are measured: from both follow what is fixed and what grows."""
FULL = 4
"""How many times the size of a quarter-size scene is in each of its dimensions."""
EMPTY_TASKS = 2000
Size = tuple[int, int, int]
"""Rows, columns, disparities."""
Kind = tuple[str, str]
"""A product, and the function of a task for it."""


@dataclass(frozen=True)
class Work:
    """A task of the simulation: what it waits for, and the seconds that it takes."""

    needs: frozenset[str]
    seconds: float


@dataclass(frozen=True)
class Outcome:
    """What a simulation found, in seconds: of the whole, of all tasks, of the longest chain, of the scheduler."""

    whole: float
    work: float
    chain: float
    scheduler: float
    chain_products: Mapping[str, float]


def kind_of(key: str) -> Kind:
    """Return the kind of the task of a key."""
    product, _, rest = key.partition("-")
    return product, rest.partition("-")[0]


def scene_of(size: Size) -> str:
    """Return a synthetic scene of this size: planning draws nothing."""
    return f"synthetic:train=0,test=1,height={size[0]},width={size[1]},disparities={size[2]}"


def sizes_in(folder: Path) -> Iterator[Size]:
    """Yield the full sizes of the quarter-size scenes in a folder of Middlebury."""
    for scene in open_dataset(f"middlebury:{folder}").scenes:
        (rows, columns), disparities = scene.size, scene.disparities
        yield rows * FULL, columns * FULL, (disparities.maximum - disparities.minimum + 1) * FULL


def amounts(plan: Plan, size: Size) -> dict[str, int]:
    """Return by product what its time is in proportion to: its cells if a volume is made or read, else its pixels."""
    volumes = {
        each.step.product for each in plan.steps if any("d" in output.dims for output in each.step.stage.outputs)
    }
    pixels, cells = size[0] * size[1], size[0] * size[1] * size[2]
    return {
        each.step.product: cells if volumes & {each.step.product, *each.step.inputs} else pixels for each in plan.steps
    }


def measured(size: Size, preset: str) -> tuple[dict[Kind, float], dict[str, int]]:
    """Return the seconds of all tasks of a kind on one thread, and what they are in proportion to by product."""
    found: dict[Kind, float] = defaultdict(float)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder, Profiler() as profiler:
        task = Task(scene_of(size), cache=Path(folder), preset=preset)
        amount = amounts(status(task), size)
        run(task, workers=1)
    for each in profiler.results:
        found[kind_of(each.key)] += each.end_time - each.start_time
    return found, amount


def rates(preset: str) -> dict[Kind, tuple[float, float]]:
    """Return the fixed seconds of all tasks of a kind, and those for each pixel or cell."""
    measured(MEASURED[0], preset)  # it compiles loops
    (small, less), (large, more) = (measured(size, preset) for size in MEASURED)
    found = {}
    for kind in small.keys() & large.keys():
        product = kind[0]
        slope = max(0.0, (large[kind] - small[kind]) / (more[product] - less[product])) if product in less else 0.0
        found[kind] = max(0.0, small[kind] - slope * less.get(product, 0)), slope
    return found


def graph_of(size: Size, preset: str, rate: Mapping[Kind, tuple[float, float]]) -> dict[str, Work]:
    """Return the tasks of one scene by key: those that a cluster is given, and the seconds of each."""
    with tempfile.TemporaryDirectory() as folder:
        plan = status(Task(scene_of(size), cache=Path(folder), preset=preset))
    context: Any = None
    graph, _ = make_graph(plan, context)
    amount, count = amounts(plan, size), Counter(map(kind_of, graph))
    seconds = {
        kind: (rate[kind][0] + rate[kind][1] * amount.get(kind[0], 0)) / tasks if kind in rate else 0.0
        for kind, tasks in count.items()
    }
    return {key: Work(frozenset(map(str, task.dependencies)), seconds[kind_of(key)]) for key, task in graph.items()}


def simulate(tasks: Mapping[str, Work], order: Mapping[str, int], workers: int, handling: float) -> Outcome:
    """Carry tasks out on idle workers, those first that ``order`` puts first."""
    waits = {key: len(task.needs) for key, task in tasks.items()}
    after: dict[str, list[str]] = defaultdict(list)
    for key, task in tasks.items():
        for need in task.needs:
            after[need].append(key)
    ready = [(order[key], key) for key, count in waits.items() if not count]
    heapq.heapify(ready)
    running: list[tuple[float, str]] = []
    chain: dict[str, tuple[float, str]] = {}
    now = free = 0.0
    while ready or running:
        while ready and len(running) < workers:
            _, key = heapq.heappop(ready)
            free = max(free, now) + handling
            heapq.heappush(running, (free + tasks[key].seconds, key))
        now, done = heapq.heappop(running)
        longest, last = max(((chain[need][0], need) for need in tasks[done].needs), default=(0.0, ""))
        chain[done] = longest + tasks[done].seconds, last
        for key in after[done]:
            waits[key] -= 1
            if not waits[key]:
                heapq.heappush(ready, (order[key], key))
    length, end = max((seconds, key) for key, (seconds, _) in chain.items())
    work = sum(task.seconds for task in tasks.values())
    return Outcome(now, work, length, handling * len(tasks), _products_of(tasks, chain, end))


def _products_of(tasks: Mapping[str, Work], chain: Mapping[str, tuple[float, str]], end: str) -> dict[str, float]:
    """Return the seconds of each product on the longest chain, the longest first."""
    found: dict[str, float] = defaultdict(float)
    while end:
        found[end.split("-", 1)[0]] += tasks[end].seconds
        end = chain[end][1]
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def handling_seconds() -> float:
    """Return what a scheduler of Dask takes for one task that does nothing, on two workers of this machine."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=60) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        client.gather(client.map(str, range(100)))
        return timed(lambda: client.gather(client.map(repr, range(EMPTY_TASKS)))) / EMPTY_TASKS


def main(
    folder: Annotated[Path, typer.Argument(help="quarter-size scenes of Middlebury")],
    workers: Annotated[list[int] | None, typer.Option()] = None,
    preset: Annotated[str, typer.Option()] = "robust",
) -> None:
    """Print the efficiency on each number of workers, and what bounds it."""
    from dask.order import order

    rate, handling, sizes = rates(preset), handling_seconds(), list(sizes_in(folder))
    tasks: dict[str, Work] = {}
    for size in sizes:
        tasks |= graph_of(size, preset, rate)
    first = order({key: (str, *task.needs) for key, task in tasks.items()})
    print(f"{len(sizes)} scenes, {len(tasks)} tasks, {1000 * handling:.2f} ms of the scheduler each")
    rows = {count: simulate(tasks, first, count, handling) for count in workers or [1, 8, 16, 32, 64, 128]}
    for count, found in rows.items():
        _tell(count, found)
    write("simulation", {"preset": preset, "rows": {str(count): vars(found) for count, found in rows.items()}})


def _tell(workers: int, found: Outcome) -> None:
    bounds = {
        "work": found.work / workers,
        "the longest chain": found.chain,
        "the scheduler": found.scheduler,
    }
    chain: Sequence[str] = [f"{name} {seconds:.0f} s" for name, seconds in list(found.chain_products.items())[:3]]
    told = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in bounds.items())
    Console(width=160).print(
        f"{workers} workers: {found.whole:.0f} s, {100 * found.work / workers / found.whole:.0f} % of their time at "
        f"work; bounds: {told} ({', '.join(chain)})"
    )


if __name__ == "__main__":
    as_command(main)
