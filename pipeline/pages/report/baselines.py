"""Find cached results of other matchers and confidence measures, and compare them on the scenes of a report."""

import dataclasses
from collections.abc import Mapping, Sequence

from semidense.cache import Entry, Recipe, Store
from semidense.pipeline.comparison.methods import MATCHERS, MEASURES, matcher_rows, measure_rows
from semidense.pipeline.comparison.rows import Judged, Row
from semidense.pipeline.plan.environment import missing_packages
from semidense.pipeline.plan.plan import Planned, close_ranges, make_plan
from semidense.pipeline.plan.steps import SPLIT, Request, Step
from semidense.stages.catalog import STAGES

OWN = ("disparity", "confidence")
"""Products of the pipeline itself that a comparison reads."""
PRODUCTS = tuple(
    dict.fromkeys((*MATCHERS.values(), *(product for product, _ in MEASURES.values() if product not in OWN)))
)
"""The baselines."""


def cached_baselines(request: Request, store: Store) -> dict[str, dict[str, str]]:
    """Return the keys of the baselines that are cached: scene -> product -> key. Nothing is made.

    A learnt measure counts whichever scenes it was trained on; of several results the latest is taken. A measure whose
    packages are not installed is left out: their versions are part of its key.
    """
    known = tuple(scene for scene in request.dataset.scenes if scene.has_truth)
    if not known:
        return {}
    wanted = dataclasses.replace(
        request,
        dataset=dataclasses.replace(request.dataset, scenes=known),
        upto="disparity",
        also=tuple(product for product in PRODUCTS if _can_be_keyed(product)),
    )
    plan = make_plan(close_ranges(wanted, store), store)
    search = _Search(store, {planned.step.id: planned for planned in plan.steps})
    found: dict[str, dict[str, str]] = {}
    for step_id, _ in plan.targets:
        step = search.steps[step_id].step
        key = search.key(step_id) if step.product in PRODUCTS else None
        if key:
            found.setdefault(step.scene, {})[step.product] = key
    return found


def _can_be_keyed(product: str) -> bool:
    stages = [STAGES[name] for name in (product, *STAGES[product].inputs) if name in STAGES]
    return not any(missing_packages(stage) for stage in stages)


class _Search:
    """Finds the cached entry of a step; for a learnt product, whichever scenes it was trained on."""

    def __init__(self, store: Store, steps: Mapping[str, Planned]) -> None:
        self.store, self.steps = store, steps
        self._entries: list[Entry] | None = None

    @property
    def entries(self) -> list[Entry]:
        """All records of the cache, the latest first."""
        if self._entries is None:
            self._entries = sorted(self.store.entries(), key=lambda entry: entry.created, reverse=True)
        return self._entries

    def key(self, step_id: str) -> str | None:
        """Return the key of a step's result; None if it is not cached."""
        planned = self.steps[step_id]
        if planned.state == "hit" or not self._is_learnt(planned.step):
            return planned.key if planned.state == "hit" else None
        fitting = (entry for entry in self.entries if self._fits(entry, planned.step))
        return next((entry.key for entry in fitting if self.store.check(entry.key) is None), None)

    def _is_learnt(self, step: Step) -> bool:
        inputs = [self.steps[each].step for ids in step.inputs.values() for each in ids]
        return any(each.scene == SPLIT and "shipped" not in each.settings for each in inputs)

    def _fits(self, entry: Entry, step: Step) -> bool:
        """Return whether an entry differs from the step's result only in the scenes that were trained on."""
        return _same(entry.recipe, step) and all(
            self._is_made_from(entry.recipe, product, ids) for product, ids in step.inputs.items()
        )

    def _is_made_from(self, recipe: Recipe, product: str, ids: Sequence[str]) -> bool:
        planned, content = self.steps[ids[0]], recipe.inputs.get(product)
        if planned.step.scene != SPLIT:
            return content == planned.digest
        return any(entry.digest == content and _same(entry.recipe, planned.step) for entry in self.entries)


def _same(recipe: Recipe, step: Step) -> bool:
    """Return whether a recipe agrees with a step in all but its inputs."""
    return recipe == Recipe(step.product, step.code, step.settings, recipe.inputs, step.environment)


def compared_rows(
    scene: str, keys: Mapping[str, str], store: Store, masks: Sequence[str], thresholds: Sequence[float]
) -> list[Row]:
    """Return the rows that ``pipeline compare`` would give for the cached products of a scene.

    Args:
        scene: its name.
        keys: of the products that are cached, baselines among them.
        store: the cache.
        masks: the masks to give figures for, of ``MASKS``.
        thresholds: the errors to give figures for, px, of ``THRESHOLDS``.
    """
    if not {"truth", *OWN} <= set(keys):
        return []
    products = {name: store.read(keys[name]) for name in ("truth", *OWN, *PRODUCTS) if name in keys}
    judged = Judged(scene, products["truth"], masks, thresholds)
    return [*matcher_rows(judged, products), *measure_rows(judged, products)]
