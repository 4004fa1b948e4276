"""The verbs of the command line as functions. Products come back as lazy xarray datasets."""

import functools
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypedDict, Unpack

from semidense.cache import Store
from semidense.datasets import Dataset, SceneSource, open_dataset
from semidense.datasets.formats.files import user_path
from semidense.pipeline.execution.retry import attempt
from semidense.pipeline.execution.tasks import provenance
from semidense.pipeline.execution.watch import Unwatched, Watch
from semidense.pipeline.plan.arguments import Texts, require_path, require_workers, texts
from semidense.pipeline.plan.config import Config, Settings, setting_texts
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.plan import Made, Plan, Planned, close_ranges, make_plan
from semidense.pipeline.plan.presets import DEFAULT
from semidense.pipeline.plan.steps import Request
from semidense.pipeline.plan.training_split import training_scenes
from semidense.pipeline.results.metric_rows import METHOD
from semidense.pipeline.results.result import Result
from semidense.pipeline.variants import Swept, Thresholds, variants_of, without_effect
from semidense.stages.evaluation.filtering import SemidenseParams

CACHE_VARIABLE = "PIPELINE_CACHE"
Cache = Path | str | Store | None
"""Where results are kept: a folder, a URL, or an opened cache; None for the default of ``open_store``."""


def open_store(folder: Cache = None) -> Store:
    """Return the cache in ``folder``, or at a URL; by default in ``$PIPELINE_CACHE`` or the user's cache folder.

    Raises:
        UsageError: if ``folder`` is no path, URL or opened cache.
    """
    from platformdirs import user_cache_path

    if isinstance(folder, Store):
        return folder
    require_path("cache", folder, "a folder, a URL, or what open_store returns")
    chosen = str(folder or os.environ.get(CACHE_VARIABLE) or user_cache_path("semidense-stereo", appauthor=False))
    return Store(chosen if "://" in chosen else user_path(chosen))


Data = str | Path | Dataset
"""What a dataset is named by: a specification such as ``middlebury:DIR``, a folder, or an opened one."""


class Options(TypedDict, total=False):
    """What all verbs share, by name; ``Task`` says what each is."""

    scenes: Texts
    settings: Settings
    config: Path | str | None
    train: bool
    cache: Cache
    preset: str


@dataclass(frozen=True)
class Task:
    """What a user asks for: the arguments that all verbs share.

    Attributes:
        dataset: such as ``motorcycle`` or ``middlebury:DIR``, see ``datasets.describe``; a folder in a benchmark's
            layout; or an opened one.
        scenes: names of scenes; none for all of the dataset.
        settings: such as ``{"costvolume.mode": "fast"}`` or ``["costvolume.mode=fast"]``, over the file's and the
            defaults; kept as the latter.
        config: a TOML file.
        train: train the networks on the training scenes instead of taking the shipped weights.
        cache: the cache's folder or URL, or an opened cache.
        preset: named settings to start from, ``paper`` or ``robust``; the file's and ``settings`` refine them.

    Raises:
        UsageError: if ``scenes``, ``settings`` or ``config`` is of another kind.
    """

    dataset: Data = "motorcycle"
    scenes: Texts = ()
    settings: Settings = ()
    config: Path | str | None = None
    train: bool = False
    cache: Cache = None
    preset: str = DEFAULT

    def __post_init__(self) -> None:
        """Bring what may be typed in several ways into one form."""
        object.__setattr__(self, "settings", setting_texts(self.settings))
        object.__setattr__(self, "scenes", texts("scenes", self.scenes))
        require_path("config", self.config, "a TOML file; settings takes single settings")

    @classmethod
    def of(cls, dataset: "Data | Task", **options: Unpack[Options]) -> "Task":
        """Return the task that a verb's arguments describe; options refine one that is given."""
        return replace(dataset, **options) if isinstance(dataset, Task) else cls(dataset, **options)

    @property
    def spec(self) -> str:
        """The dataset as it was named."""
        return self.dataset.spec if isinstance(self.dataset, Dataset) else str(self.dataset)

    def and_settings(self, further: Settings) -> "Task":
        """Return the task with further settings, which win."""
        return replace(self, settings=(*setting_texts(self.settings), *setting_texts(further)))

    def configuration(self) -> Config:
        """Return the configuration that the preset, the file and the settings describe.

        Raises:
            UsageError: if one of them is not valid.
        """
        return Config.load(Path(self.config) if self.config else None, setting_texts(self.settings), self.preset)

    def open(self) -> Dataset:
        """Return the dataset, narrowed to the scenes that are named.

        Raises:
            DatasetError: if it cannot be read.
        """
        whole = self._whole()
        return whole.select(self.scenes) if self.scenes else whole

    def _whole(self) -> Dataset:
        return self.dataset if isinstance(self.dataset, Dataset) else open_dataset(self.spec)

    def request(self, upto: str, variants: Iterable[Sequence[str]] = ((),)) -> Request:
        """Return the request for products up to ``upto``, in one variant for each list of further settings.

        Raises:
            UsageError, DatasetError: if it cannot be carried out as it stands.
        """
        configs = {", ".join(further): self.and_settings(further).configuration() for further in variants}
        training: tuple[SceneSource, ...] = ()
        if self.train:
            others = {config.training.dataset for config in configs.values()}
            if len(others) > 1:
                raise UsageError(
                    "training.dataset cannot be swept: a sweep trains on the same scenes; run one after the other"
                )
            (other,) = others
            training = training_scenes(open_dataset(other) if other else self._whole())
        return Request(self.open(), configs, upto, self.train, training)


def status(
    dataset: Data | Task = "motorcycle",
    upto: str = "metrics",
    *,
    forced: Texts = (),
    **options: Unpack[Options],
) -> Plan:
    """Return the plan of a run: every step with its state. Nothing is made or changed."""
    task = Task.of(dataset, **options)
    return planned(task, task.request(upto), forced)


def planned(task: Task, request: Request, forced: Texts = ()) -> Plan:
    """Return the plan of a request: every step with its state. Nothing is made or changed."""
    store = open_store(task.cache)
    return _plan(close_ranges(request, store), store, texts("forced", forced))


def _plan(request: Request, store: Store, forced: Iterable[str]) -> Plan:
    """Return the plan of what is to be made; refuse a product of training scenes where there are none.

    A note names each setting that is swept and changes nothing.
    """
    plan = make_plan(request, store, forced)
    for step in (planned.step for planned in plan.steps):
        if not all(step.inputs.values()):
            raise UsageError(f"{step.product} is made from training scenes, and there are none here: add --train")
    idle = without_effect(request.configs, plan.targets)
    told = (f"{name} changes nothing here: the {request.upto} are the same for each of its values" for name in idle)
    return replace(plan, notes=(*plan.notes, *told))


def run(
    dataset: Data | Task = "motorcycle",
    upto: str = "metrics",
    *,
    forced: Texts = (),
    watch: Watch | None = None,
    scheduler: str | None = None,
    workers: int | None = None,
    **options: Unpack[Options],
) -> Result:
    """Make the products of a dataset up to ``upto``, reusing all that is cached.

    Args:
        dataset: what to work on: a dataset, or a task that ``options`` refine.
        upto: the product to stop at.
        forced: products to make again; the new result must equal the old.
        watch: told how it goes on.
        scheduler: where tasks are carried out: ``tcp://HOST:PORT``, ``processes:N``, a scheduler file, or ``env``;
            None for threads of this process.
        workers: threads; None for one a core.
        **options: ``scenes``, ``settings``, ``config``, ``train`` and ``cache``, as ``Task`` has them.

    Raises:
        UsageError, DatasetError, CacheError, StageError: what the user can mend, in one line.
        StageFailed: a fault of a stage, with its cause.
    """
    task = Task.of(dataset, **options)
    return carry_out(task, task.request(upto), forced, watch, scheduler, workers)


def carry_out(
    task: Task,
    request: Request,
    forced: Texts,
    watch: Watch | None,
    scheduler: str | None,
    workers: int | None,
) -> Result:
    """Make what a request asks for; see ``run``."""
    require_workers(workers)
    again = texts("forced", forced)
    store = open_store(task.cache)
    extras = provenance(sys.argv)

    def make(wanted: Request, forced: Iterable[str] = ()) -> tuple[Plan, dict[str, Made]]:
        plan_again = functools.partial(_plan, wanted, store, forced)
        return attempt(plan_again, store, watch or Unwatched(), extras, scheduler, workers)

    plan, made = make(close_ranges(request, store, lambda wanted: make(wanted)[1]), again)
    return Result(plan, made, store, list(_metric_rows(plan, store, made)), task.preset)


def _metric_rows(plan: Plan, store: Store, made: Mapping[str, Made]) -> Iterator[dict[str, Any]]:
    """Yield the rows of every metrics product that was asked for."""
    from semidense.stages.metrics.stage import metric_rows

    for step_id, variant in plan.targets:
        each = made[step_id]
        if each.step.product == "metrics":
            arrays = store.read(each.key)
            named = {"variant": variant} if variant else {}
            yield from (row | named for row in metric_rows(each.step.scene, METHOD, each.step.R, arrays))


def sweep(
    dataset: Data | Task = "motorcycle",
    R: Thresholds = None,
    over: Swept = (),
    *,
    watch: Watch | None = None,
    scheduler: str | None = None,
    workers: int | None = None,
    **options: Unpack[Options],
) -> Result:
    """Make the metrics for every value of R, and for every combination of several values of settings.

    Args:
        dataset: what to work on: a dataset, or a task that ``options`` refine.
        R: confidence thresholds, or ``first:last:step`` with the last one included; None takes 0.05:0.95:0.05 where R
            decides, and none where ``semidense.density`` or ``semidense.max_error`` does.
        over: ``{"section.field": [value1, value2]}`` or ``section.field=value1,value2``; all combinations are made.
        watch: as for ``run``.
        scheduler: as for ``run``.
        workers: as for ``run``.
        **options: as for ``run``.

    Returns:
        One result with the metrics of all variants; ``variant`` in each row names the combination.
    """
    task = Task.of(dataset, **options)
    return carry_out(task, sweep_request(task, R, over), (), watch, scheduler, workers)


def sweep_request(task: Task, R: Thresholds, over: Swept) -> Request:
    """Return the request of a sweep, as ``sweep`` takes it; refused where no scene has a ground truth: UsageError."""
    by_R = task.configuration().of("semidense", SemidenseParams).by_R
    request = task.request("metrics", variants_of(R, over, by_R))
    if not any(scene.has_truth for scene in request.dataset.scenes):
        raise UsageError(f"{request.dataset.spec}: no scene asked for has a ground truth to judge maps by")
    return request


def explain(dataset: Data | Task, product: str, scene: str | None = None, **options: Unpack[Options]) -> Planned:
    """Return a product's step with its state; ``step.recipe`` and ``changed`` say what its key is made of.

    Raises:
        UsageError: if there is no such product, or several scenes fit.
    """
    task = Task.of(dataset, **options)
    plan = status(task, product)
    targets = dict(plan.targets)
    asked = [planned for planned in plan.steps if planned.step.id in targets and planned.step.product == product]
    found = [each for each in asked if scene in (None, each.step.scene, each.step.scene.rsplit("/", 1)[-1])]
    if not asked and plan.notes:
        raise UsageError(f"no {product} yet: {plan.notes[0]}")
    if len(found) != 1:
        names = ", ".join(each.step.scene for each in asked) or "none"
        raise UsageError(f"{product} of {scene or task.spec}: {len(found)} scenes fit ({names}); name one")
    return found[0]
