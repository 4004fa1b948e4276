"""The verbs of the command line as functions. Products come back as lazy xarray datasets."""

import functools
import itertools
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from semidense.cache import Store
from semidense.datasets import Dataset, SceneSource, open_dataset
from semidense.pipeline.execution.retry import attempt
from semidense.pipeline.execution.tasks import provenance
from semidense.pipeline.execution.watch import Unwatched, Watch
from semidense.pipeline.plan.config import Config, parse_setting
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.plan import Made, Plan, Planned, make_plan
from semidense.pipeline.plan.ranges import close_ranges
from semidense.pipeline.plan.steps import Request
from semidense.pipeline.plan.training_split import training_scenes
from semidense.pipeline.results.opening import open_product

if TYPE_CHECKING:
    import xarray as xr

CACHE_VARIABLE = "PIPELINE_CACHE"
METHOD = "dual-cnn"
"""What this pipeline is called in the rows of metrics."""


def open_store(folder: Path | str | None = None) -> Store:
    """Return the cache in ``folder``; by default in ``$PIPELINE_CACHE``, else in the user's cache folder."""
    from platformdirs import user_cache_path

    chosen = folder or os.environ.get(CACHE_VARIABLE) or user_cache_path("semidense-stereo", appauthor=False)
    return Store(Path(chosen).expanduser())


@dataclass(frozen=True)
class Task:
    """What a user asks for: the arguments that all verbs share.

    Attributes:
        dataset: such as ``motorcycle`` or ``middlebury:DIR``, see ``datasets.describe``; or an opened one.
        scenes: names of scenes; none for all of the dataset.
        settings: ``section.field=value``, over the file's and the defaults.
        config: a TOML file.
        train: train the networks on the training scenes instead of taking the shipped weights.
        cache: the cache's folder.
    """

    dataset: str | Dataset = "motorcycle"
    scenes: Sequence[str] = ()
    settings: Sequence[str] = ()
    config: Path | None = None
    train: bool = False
    cache: Path | str | None = None

    def request(self, upto: str, variants: Iterable[Sequence[str]] = ((),)) -> Request:
        """Return the request for products up to ``upto``, in one variant for each list of further settings.

        Raises:
            UsageError, DatasetError: if it cannot be carried out as it stands.
        """
        configs = {", ".join(further): Config.load(self.config, [*self.settings, *further]) for further in variants}
        whole = open_dataset(self.dataset) if isinstance(self.dataset, str) else self.dataset
        dataset = whole.select(self.scenes) if self.scenes else whole
        training: tuple[SceneSource, ...] = ()
        if self.train:
            other = next(iter(configs.values())).training.dataset
            training = training_scenes(open_dataset(other) if other else whole)
        return Request(dataset, configs, upto, self.train, training)


@dataclass(frozen=True)
class Result:
    """What a run made or found.

    Attributes:
        plan: as it was before the run.
        made: the result of each step, by its id.
        store: the cache.
        metrics: rows as promised to scripts; empty if the run stopped before ``metrics``.
    """

    plan: Plan
    made: Mapping[str, Made]
    store: Store
    metrics: list[dict[str, Any]] = field(default_factory=list)

    def find(self, product: str, scene: str | None = None) -> Made:
        """Return the result of a product; of a scene, if there are several.

        Raises:
            UsageError: if there is none, or several fit.
        """
        found = [
            made
            for made in self.made.values()
            if made.step.product == product and scene in (None, made.step.scene, made.step.scene.rsplit("/", 1)[-1])
        ]
        if len(found) != 1:
            names = ", ".join(sorted({made.step.scene for made in found})) or "none"
            raise UsageError(
                f"{product} of {scene or 'the only scene'}: {len(found)} results fit ({names}); name a scene"
            )
        return found[0]

    def open(self, product: str, scene: str | None = None) -> "xr.Dataset":
        """Return a product as a lazy dataset with coordinates, units and provenance; see ``open_product``."""
        return open_product(self.store, self.find(product, scene).key)


def status(task: Task | str = "motorcycle", upto: str = "metrics", forced: Sequence[str] = ()) -> Plan:
    """Return the plan of a run: every step with its state. Nothing is made or changed."""
    task = Task(task) if isinstance(task, str) else task
    store = open_store(task.cache)
    return make_plan(close_ranges(task.request(upto), store), store, forced)


def run(
    task: Task | str = "motorcycle",
    upto: str = "metrics",
    *,
    forced: Sequence[str] = (),
    watch: Watch | None = None,
    scheduler: str | None = None,
    workers: int | None = None,
) -> Result:
    """Make the products of a dataset up to ``upto``, reusing all that is cached.

    Args:
        task: what to work on; a text is a dataset.
        upto: the product to stop at.
        forced: products to make again; the new result must equal the old.
        watch: told how it goes on.
        scheduler: address of a Dask scheduler, ``tcp://...``; None for threads of this process.
        workers: threads; None for one a core.

    Raises:
        UsageError, DatasetError, CacheError, StageError: what the user can mend, in one line.
        StageFailed: a fault of a stage, with its cause.
    """
    task = Task(task) if isinstance(task, str) else task
    return carry_out(task, task.request(upto), forced, watch, scheduler, workers)


def carry_out(
    task: Task,
    request: Request,
    forced: Sequence[str],
    watch: Watch | None,
    scheduler: str | None,
    workers: int | None,
) -> Result:
    """Make what a request asks for; see ``run``."""
    store = open_store(task.cache)
    extras = provenance(sys.argv)

    def make(wanted: Request, forced: Iterable[str] = ()) -> tuple[Plan, dict[str, Made]]:
        planned = functools.partial(make_plan, wanted, store, forced)
        return attempt(planned, store, watch or Unwatched(), extras, scheduler, workers)

    plan, made = make(close_ranges(request, store, lambda wanted: make(wanted)[1]), forced)
    return Result(plan, made, store, list(_metric_rows(plan, store, made)))


def _metric_rows(plan: Plan, store: Store, made: Mapping[str, Made]) -> Iterator[dict[str, Any]]:
    """Yield the rows of every metrics product that was asked for."""
    from semidense.stages.metrics import metric_rows

    for step_id, variant in plan.targets:
        each = made[step_id]
        if each.step.product == "metrics":
            arrays = store.read(each.key)
            named = {"variant": variant} if variant else {}
            yield from (row | named for row in metric_rows(each.step.scene, METHOD, each.step.R, arrays))


def mask_kinds(result: Result) -> dict[str, str]:
    """Return where the non-occlusion mask of each scene of a run comes from."""
    from semidense.pipeline.plan.images_and_truth import MASK_KINDS

    truths = [made for made in result.made.values() if made.step.product == "truth"]
    return {
        made.step.scene: MASK_KINDS[int(np.asarray(result.store.arrays(made.key)["mask_kind"][...])[0])]
        for made in truths
    }


def sweep(
    task: Task | str = "motorcycle",
    R: str | Sequence[float] = "0.05:0.95:0.05",
    settings: Sequence[str] = (),
    *,
    watch: Watch | None = None,
    scheduler: str | None = None,
    workers: int | None = None,
) -> Result:
    """Make the metrics for every value of R, and for every combination of several values of settings.

    Args:
        task: what to work on; a text is a dataset.
        R: confidence thresholds, or ``first:last:step`` with the last one included.
        settings: ``section.field=value1,value2``; all combinations are made.
        watch: as for ``run``.
        scheduler: as for ``run``.
        workers: as for ``run``.

    Returns:
        One result with the metrics of all variants; ``variant`` in each row names the combination.
    """
    task = Task(task) if isinstance(task, str) else task
    thresholds = [f"semidense.R={value:g}" for value in parse_thresholds(R)]
    variants = [
        (threshold, *combination)
        for combination in itertools.product(*(_alternatives(setting) for setting in settings))
        for threshold in thresholds
    ]
    return carry_out(task, task.request("metrics", variants), (), watch, scheduler, workers)


def _alternatives(setting: str) -> list[str]:
    """Return ``section.field=v1,v2`` as one setting a value."""
    section, name, values = parse_setting(setting)
    return [f"{section}.{name}={value}" for value in values.split(",")]


def parse_thresholds(R: str | Sequence[float]) -> list[float]:
    """Return the thresholds that ``first:last:step``, ``value,value`` or a sequence names.

    Raises:
        UsageError: if it is none of these, or a threshold lies outside [0, 1].

    >>> parse_thresholds("0.1:0.3:0.1")
    [0.1, 0.2, 0.3]
    """
    try:
        values = _span(R) if isinstance(R, str) and ":" in R else _list(R)
    except ValueError:
        raise UsageError(f"R = {R!r}: write a number, numbers with commas, or first:last:step") from None
    outside = [value for value in values if not 0 <= value <= 1]
    if outside or not values:
        raise UsageError(
            f"R = {R!r}: every threshold must lie in [0, 1]" + (f", not {outside[0]:g}" if outside else "")
        )
    return values


def _span(text: str) -> list[float]:
    first, last, step = (float(part) for part in text.split(":"))
    if step <= 0 or last < first or (last - first) / step > 1000:
        raise ValueError
    return [round(first + index * step, 10) for index in range(int((last - first) / step + 1e-9) + 1)]


def _list(R: str | Sequence[float]) -> list[float]:
    return [float(part) for part in (R.split(",") if isinstance(R, str) else R)]


def explain(task: Task, product: str, scene: str | None = None) -> Planned:
    """Return a product's step with its state; ``step.recipe`` and ``changed`` say what its key is made of.

    Raises:
        UsageError: if there is no such product, or several scenes fit.
    """
    plan = status(task, product)
    targets = dict(plan.targets)
    asked = [planned for planned in plan.steps if planned.step.id in targets and planned.step.product == product]
    found = [each for each in asked if scene in (None, each.step.scene, each.step.scene.rsplit("/", 1)[-1])]
    if not asked and plan.notes:
        raise UsageError(f"no {product} yet: {plan.notes[0]}")
    if len(found) != 1:
        names = ", ".join(each.step.scene for each in asked) or "none"
        raise UsageError(f"{product} of {scene or task.dataset}: {len(found)} scenes fit ({names}); name one")
    return found[0]
