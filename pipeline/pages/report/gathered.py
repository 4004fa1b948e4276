"""Gather what is cached for a dataset: the plan of a run, each scene's steps, and their maps and figures."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from semidense.cache import Entry, Store
from semidense.pipeline.api import Task, open_store, status
from semidense.pipeline.files.suggestion import run_command
from semidense.pipeline.pages.report.baselines import cached_baselines, compared_rows
from semidense.pipeline.pages.scene_maps import SceneMaps
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.plan import Plan, Planned
from semidense.pipeline.plan.steps import NETS, SPLIT
from semidense.pipeline.results.metric_rows import MASK, METHOD, THRESHOLD
from semidense.pipeline.results.provenance import lineage
from semidense.stages.evaluation.filtering import SemidenseParams
from semidense.stages.metrics.stage import metric_rows


@dataclass(frozen=True, eq=False)
class GatheredScene:
    """A scene and its cached products.

    Attributes:
        name: its name.
        steps: the steps that are cached, by product.
        store: the cache.
        baselines: keys of the other matchers and confidence measures that are cached, by product.
    """

    name: str
    steps: Mapping[str, Planned]
    store: Store
    baselines: Mapping[str, str]

    @property
    def keys(self) -> dict[str, str]:
        """The keys of the cached products, by product."""
        return {product: planned.key for product, planned in self.steps.items() if planned.key}

    @cached_property
    def maps(self) -> SceneMaps | None:
        """The scene's maps; None if there is nothing to look at."""
        return SceneMaps.read(self.store, self.keys) if {"images", "disparity"} & set(self.steps) else None

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of its figures; empty if ``metrics`` is not cached."""
        if "metrics" not in self.steps:
            return []
        return metric_rows(self.name, METHOD, self.steps["metrics"].step.R, self.store.read(self.keys["metrics"]))

    @cached_property
    def compared(self) -> list[dict[str, Any]]:
        """The rows of the comparison with the baselines that are cached, at ``MASK`` and ``THRESHOLD``."""
        return compared_rows(self.name, {**self.keys, **self.baselines}, self.store, [MASK], [THRESHOLD])


@dataclass(frozen=True, eq=False)
class Gathered:
    """Everything that a report shows.

    Attributes:
        task: what the report is about.
        plan: the plan of a run up to ``metrics``, every step with its state.
        store: the cache.
        scenes: the scenes of the task for which something is cached.
        filtering: what the configuration keeps of a map.
    """

    task: Task
    plan: Plan
    store: Store
    scenes: tuple[GatheredScene, ...]
    filtering: SemidenseParams

    @property
    def hits(self) -> list[Planned]:
        """The steps that are cached."""
        return [planned for planned in self.plan.steps if planned.state == "hit"]

    @cached_property
    def entries(self) -> dict[str, Entry]:
        """The records of all cached products, by key; of baselines too."""
        keys = [planned.key for planned in self.hits if planned.key]
        keys += [key for scene in self.scenes for key in scene.baselines.values()]
        return {key: self.store.require(key) for key in keys}

    @cached_property
    def networks(self) -> dict[str, Planned]:
        """The steps of the networks that are cached."""
        return {each.step.product: each for each in self.hits if each.step.product in NETS}

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of the figures of all scenes."""
        return [row for scene in self.scenes for row in scene.rows]

    @property
    def compared(self) -> list[dict[str, Any]]:
        """The rows of the comparison of all scenes."""
        return [row for scene in self.scenes for row in scene.compared]


def gather(task: Task) -> Gathered:
    """Look up what a run of ``task`` up to the metrics would find in the cache. Nothing is made.

    Raises:
        UsageError: if nothing of any scene is cached, with the command that makes it.
    """
    store, plan = open_store(task.cache), status(task)
    request = task.request("metrics")
    baselines = cached_baselines(request, store)
    by_id = {planned.step.id: planned for planned in plan.steps}
    scenes = []
    for target, _ in plan.targets:
        steps = {step.product: by_id[step.id] for step in lineage(by_id, target) if by_id[step.id].state == "hit"}
        if {planned.step.scene for planned in steps.values()} - {SPLIT}:
            name = by_id[target].step.scene
            scenes.append(GatheredScene(name, steps, store, baselines.get(name, {})))
    if not scenes:
        raise UsageError(f"nothing of {task.spec} is cached in {store.root}: make it with `{run_command(task)}`")
    config = next(iter(request.configs.values()))
    return Gathered(task, plan, store, tuple(scenes), config.of("semidense", SemidenseParams))
