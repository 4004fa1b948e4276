"""Planning and running a data set of many tiny scenes: ``python -m benchmarks.many_scenes``.

- *All cached*: one scene is matched. The products of all scenes are published as copies of its arrays that differ in
  two bytes, so that the cache has as many entries as it would have. Nothing is computed in what is timed.
- *Many variants*: the maps of one scene are published under many settings, as sweeps leave them. Planning another
  setting compares with the nearest of them.
- *From nothing*: a run of some scenes that are so small that much of the time is not the stages' own; then another
  on one thread, whose processor time is told apart: what the functions of the stages take, and all the rest.
"""

import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any
from unittest.mock import patch

import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks.harness import Ratio, Side, as_command, report, timed
from semidense.cache import Store
from semidense.cache.entries import check
from semidense.pipeline.api import Task, open_store, run, status
from semidense.pipeline.cli.commands.cache.cleaning import Wish
from semidense.pipeline.execution import tasks
from semidense.pipeline.plan.building import build
from semidense.pipeline.plan.steps import SPLIT, Step
from semidense.pipeline.results.provenance import ancestry

SECONDS = {"status": 4.0, "run": 5.0, "cache gc --keep": 5.0, "explain": 4.0}
"""What each command may take at 500 scenes."""
PLANNING = 2.0
"""Seconds that a plan may take beside 1,000 variants."""
A_SCENE = 0.1
"""Seconds that a scene may take in a run from nothing, and of processor time beside its stages."""


def fill(task: Task, donor: Task) -> None:
    """Publish every product that a run of ``task`` makes, with the arrays of the one scene of ``donor``."""
    made = run(donor)
    arrays = {each.step.product: made.store.read(each.key) for each in made.made.values()}
    store, digests = open_store(task.cache), dict[str, str]()
    for number, step in enumerate(build(task.request("metrics")).steps.values()):
        changed = arrays[step.product] if step.scene == SPLIT else marked(arrays[step.product], number)
        digests[step.id] = publish(store, step, digests, changed)


def marked(arrays: dict[str, NDArray[np.generic]], number: int) -> dict[str, NDArray[np.generic]]:
    """Return arrays of which one holds a number in its first two bytes."""
    name = max(arrays, key=lambda each: arrays[each].nbytes)
    copy = np.ascontiguousarray(arrays[name]).copy()
    copy.reshape(-1).view(np.uint8)[:2] = np.frombuffer(number.to_bytes(2, "little"), np.uint8)
    return {**arrays, name: copy}


def publish(store: Store, step: Step, digests: dict[str, str], arrays: dict[str, NDArray[np.generic]]) -> str:
    """Publish arrays as a step's product and return its digest."""
    draft = store.begin(step.recipe(digests), step.label)
    for name, array in arrays.items():
        dims = [f"{name}{axis}" for axis in range(array.ndim)]
        draft.create_array(name, array.shape, str(array.dtype), [max(1, length) for length in array.shape], dims, {})
        draft.write(name, tuple(slice(0, length) for length in array.shape), array)
    return draft.publish(0.0, {}).digest


def fill_variants(task: Task, variants: int) -> None:
    """Make the products of a task, and publish its semi-dense map under so many other settings."""
    made = run(task).made.values()
    store, (last,) = open_store(task.cache), [each for each in made if each.step.product == "semidense"]
    arrays, digests = store.read(last.key), {each.step.id: each.digest for each in made}
    for number in range(variants):
        publish(store, replace(last.step, settings={**last.step.settings, "variant": number}), digests, arrays)


def timed_anew(side: Side) -> float:
    """Return the wall time of one call in a process that has read nothing of the cache, as a command's has not."""
    check.forget()
    return timed(side)


def beside_stages(task: Task) -> float:
    """Return the processor time of a run on one thread that the functions of the stages do not take."""
    stages, call = [], tasks.call

    def timed_call(*given: Any) -> Any:  # noqa: ANN401
        started = time.process_time()
        try:
            return call(*given)
        finally:
            stages.append(time.process_time() - started)

    started = time.process_time()
    with patch.object(tasks, "call", timed_call):
        run(task, workers=1)
    return time.process_time() - started - sum(stages)


def spec(scenes: int) -> str:
    """Return a data set of so many tiny scenes."""
    return f"synthetic:train=0,test={scenes},height=48,width=64,disparities=4"


def main(
    scenes: Annotated[int, typer.Option(help="scenes of the data set that is cached")] = 500,
    variants: Annotated[int, typer.Option(help="settings that one map is cached under")] = 1000,
    fresh: Annotated[int, typer.Option(help="scenes of the run from nothing")] = 50,
) -> None:
    """Fill caches, then time each command over them once, in this process, its imports done before."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        task = Task(spec(scenes), cache=Path(folder, "cache"))
        fill(task, Task(spec(1), cache=Path(folder, "donor")))
        key = str(status(task).steps[-1].key)
        sides = {
            "status": lambda: status(task),
            "run": lambda: run(task),
            "cache gc --keep": lambda: Wish(keep=(spec(scenes),)).limits(Path(folder, "cache")),
            "explain": lambda: ancestry(open_store(task.cache), key),
        }
        seconds = {name: timed_anew(side) for name, side in sides.items()}
        varied = Task(spec(1), settings=("semidense.R=0.123",), cache=Path(folder, "variants"))
        fill_variants(replace(varied, settings=()), variants)
        planning = timed_anew(lambda: status(varied))
        from_nothing = timed_anew(lambda: run(Task(spec(fresh), cache=Path(folder, "fresh"))))
        beside = beside_stages(Task(spec(fresh), cache=Path(folder, "again")))
    report(
        "many_scenes",
        [
            Ratio(f"{name}, {scenes} scenes, all cached, s", (found,), SECONDS[name] * scenes / 500, at_most=True)
            for name, found in seconds.items()
        ]
        + [
            Ratio(f"status of another setting, {variants} variants cached, s", (planning,), PLANNING, at_most=True),
            Ratio(f"run of {fresh} scenes from nothing, s a scene", (from_nothing / fresh,), A_SCENE, at_most=True),
            Ratio("processor time of that beside the stages, s a scene", (beside / fresh,), A_SCENE, at_most=True),
        ],
    )


if __name__ == "__main__":
    as_command(main)
