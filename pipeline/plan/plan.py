"""The plan of a run: every step with its key and its state, before anything is computed.

``run --dry-run``, ``status`` and ``explain`` print this very object; ``run`` executes it.
A key needs the content of what the step is made from, so below a step that is still to be made the
keys are open: such a step will be made too, unless what is above it comes out unchanged (then it is
a hit, and saved).
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from semidense.cache import ABSENT, Change, Entry, Recipe, Store, differences
from semidense.datasets import Dataset, DisparityRange, SceneSource
from semidense.pipeline.plan.building import build
from semidense.pipeline.plan.causes import PENDING, Causes
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.environment import former_version, version
from semidense.pipeline.plan.errors import UsageError, nearest
from semidense.pipeline.plan.steps import Graph, Request, Step, needs_range, products

COMPARED = 50
"""Earlier results of a product and scene that a step is compared with, the newest: a sweep leaves thousands."""
State = Literal["hit", "made", "stale", "missing"]


@dataclass(frozen=True, repr=False)
class Planned:
    """A step and what the cache has for it.

    Attributes:
        step: the step.
        state: ``hit``: it is there; ``stale``: it was made from something else before, see
            ``changed``; ``missing``: it was never made; ``made``: an execution has made it.
        key: of its result; None while it is open.
        digest: of its content; None unless it is there.
        changed: what differs from the nearest earlier result of the same product and scene.
        causes: what that comes from, a line each: the setting, function, file or weights that changed.
        damage: what is wrong with an entry that is there and cannot be used.
        seconds: what making it took, if it is there.
    """

    step: Step
    state: State
    key: str | None = None
    digest: str | None = None
    changed: tuple[Change, ...] = ()
    damage: str | None = None
    seconds: float | None = None
    causes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return product, scene and state."""
        return f"<{self.step.name}: {self.state}>"


@dataclass(frozen=True, repr=False)
class Made:
    """A product that is there: its step, the key and digest of its entry, and whether it was there before."""

    step: Step
    key: str
    digest: str
    seconds: float
    reused: bool

    def __repr__(self) -> str:
        """Return product, scene and what became of it."""
        return f"<{self.step.name}: {'reused' if self.reused else 'made'}>"


@dataclass(frozen=True, repr=False)
class Plan:
    """The steps of a run in order, and what was asked for.

    Attributes:
        steps: in the order in which they can be made.
        targets: ids of the steps that were asked for, each with its variant.
        notes: what a person should know.
        forced: products that are made again even if they are there.
    """

    steps: tuple[Planned, ...]
    targets: tuple[tuple[str, str], ...]
    notes: tuple[str, ...] = ()
    forced: frozenset[str] = frozenset()

    def __repr__(self) -> str:
        """Return how much there is and how much is to be made."""
        return f"<Plan: {len(self.steps)} products, {len(self.todo())} to make>"

    def todo(self) -> tuple[Planned, ...]:
        """Return the steps that are to be made."""
        return tuple(planned for planned in self.steps if planned.state != "hit")


def make_plan(request: Request, store: Store, forced: Iterable[str] = ()) -> Plan:
    """Return the plan of a request: changes nothing, computes nothing.

    Args:
        request: what is to be made.
        store: the cache.
        forced: products to make again.

    Raises:
        UsageError, DatasetError, StageError: if the request cannot be carried out.
        CacheUnavailable: if the cache cannot be read.
    """
    unknown = sorted(set(forced) - set(products()))
    if unknown:
        raise UsageError(f"no product {unknown[0]!r} to force; {nearest(unknown[0], products())}")
    graph = build(request)
    if idle := sorted(set(forced) - {step.product for step in graph.steps.values()}):
        raise UsageError(f"{idle[0]} cannot be forced: a run up to {request.upto} does not make it")
    return plan_graph(graph, store, forced)


def plan_graph(graph: Graph, store: Store, forced: Iterable[str] = ()) -> Plan:
    """Return the plan of steps that are known already; as ``make_plan`` otherwise."""
    planner = _Planner(store, frozenset(forced))
    planned = planner.look_at_all(tuple(graph.steps.values()))
    return Plan(planned, tuple(graph.targets), tuple(graph.notes), planner.forced)


def _levels(steps: Sequence[Step]) -> Iterator[list[Step]]:
    """Yield the steps in groups: each needs only what is in groups before its own."""
    level: dict[str, int] = {}
    for step in steps:
        level[step.id] = 1 + max((level[each] for ids in step.inputs.values() for each in ids), default=-1)
    for number in sorted(set(level.values())):
        yield [step for step in steps if level[step.id] == number]


class _Planner:
    """Decides each step's state, in order; keeps what it learnt of the steps before."""

    def __init__(self, store: Store, forced: frozenset[str]) -> None:
        self.store = store
        self.forced = forced
        self.digests: dict[str, str] = {}
        self._history: dict[tuple[tuple[str, str], ...], list[Entry]] | None = None
        self._reasons: Causes | None = None
        self._causes: dict[str, tuple[str, ...]] = {}

    def look_at_all(self, steps: Sequence[Step]) -> tuple[Planned, ...]:
        """Return the steps with their states; those that do not need one another are looked up at the same time."""
        found: dict[str, Planned] = {}
        for level in _levels(steps):
            recipes = {step.id: step.recipe(self.digests) for step in level if not self._open_inputs(step)}
            looks = self.store.look_all(recipe.key for recipe in recipes.values())
            seen = dict(zip(recipes, looks, strict=True))
            found.update((step.id, self._state(step, recipes.get(step.id), *seen.get(step.id, ()))) for step in level)
        return tuple(found[step.id] for step in steps)

    def _open_inputs(self, step: Step) -> dict[str, tuple[str, ...]]:
        """Return the inputs that are not all made yet."""
        return {product: ids for product, ids in step.inputs.items() if not all(each in self.digests for each in ids)}

    def _state(
        self, step: Step, recipe: Recipe | None, entry: Entry | None = None, damage: str | None = None
    ) -> Planned:
        """Return the step with its state, by what the cache has for its recipe; no recipe: inputs are missing."""
        if recipe is None:
            return self._not_there(step, None, self._pending(step, self._open_inputs(step)))
        if entry is None or damage or step.product in self.forced:
            changes = self._changes(step, recipe)
            if entry and not damage:  # made again it comes out equal, or the run stops: what follows from it is there
                changes, self.digests[step.id] = (Change("forced", ABSENT, step.product),), entry.digest
            return self._not_there(step, recipe, changes, damage)
        self.digests[step.id] = entry.digest
        return Planned(step, "hit", recipe.key, entry.digest, seconds=entry.seconds)

    def _not_there(
        self, step: Step, recipe: Recipe | None, changed: tuple[Change, ...], damage: str | None = None
    ) -> Planned:
        state: State = "stale" if self._earlier(step) else "missing"
        if damage:
            damage = damage.removeprefix(f"the entry {recipe.key if recipe else ''} is damaged: ")
            causes: tuple[str, ...] = (f"{step.product} is damaged: {damage}",)
        else:
            causes = self._reasons.of(step, changed, self._causes) if self._reasons else ()
        self._causes[step.id] = causes
        return Planned(step, state, recipe.key if recipe else None, changed=changed, damage=damage, causes=causes)

    def _changes(self, step: Step, recipe: Recipe) -> tuple[Change, ...]:
        """Return how a recipe differs from the nearest earlier one of the same label."""
        earlier = self._earlier(step)
        usable = [entry for entry in earlier if former_version(entry) is None]
        if earlier and not usable:
            return (Change("version", former_version(earlier[0]), version("semidense-stereo")),)
        return _fewest([differences(entry.recipe, recipe) for entry in usable])

    def _pending(self, step: Step, open_inputs: Mapping[str, tuple[str, ...]]) -> tuple[Change, ...]:
        """Return the step's own changes, and the inputs that are to be made before it."""
        pending = tuple(Change(f"inputs.{product}", ABSENT, PENDING) for product in open_inputs)
        own: list[list[Change]] = [
            [change for change in differences(entry.recipe, _own(step, entry.recipe)) if change.field != "inputs"]
            for entry in self._earlier(step)
        ]
        return (*_fewest(own), *pending)

    def _earlier(self, step: Step) -> list[Entry]:
        """Return the results of the same label, newest first; the cache is read once for all steps."""
        if self._history is None:
            self._history = {}
            entries = sorted(self.store.entries(), key=lambda entry: entry.created, reverse=True)
            self._reasons = Causes(self.store, entries)
            for entry in entries:
                self._history.setdefault(tuple(sorted(entry.label.items())), []).append(entry)
        return self._history.get(tuple(sorted(step.label.items())), [])[:COMPARED]


def _fewest(candidates: list[list[Change]]) -> tuple[Change, ...]:
    """Return the shortest list of changes; of equal ones the first, which is the newest result's."""
    shortest: list[Change] = min(candidates, key=len, default=[])
    return tuple(shortest)


def _own(step: Step, earlier: Recipe) -> Recipe:
    """Return the step's recipe as if its inputs were those of an earlier result."""
    return Recipe(step.product, step.code, step.settings, earlier.inputs, step.environment)


Make = Callable[[Request], Mapping[str, Made]]
"""Makes what is requested."""


def close_ranges(request: Request, store: Store, make: Make | None = None) -> Request:
    """Return the request with the ranges of its scenes as their surveys estimate them.

    Args:
        request: what is to be made.
        store: the cache.
        make: makes surveys that are not cached; None leaves their scenes open.

    Raises:
        UsageError: if a survey finds no range.
        StageRefused: if an image cannot be read.
    """
    unknown = tuple(scene for scene in request.dataset.scenes if scene.open_ends)
    if not unknown or not needs_range(request.upto):
        return request
    surveys = replace(request, dataset=Dataset(request.dataset.spec, unknown), upto="survey", configs=_plain(request))
    plan = make_plan(surveys, store)
    keys = {planned.step.scene: planned.key for planned in plan.steps if planned.state == "hit" and _is_survey(planned)}
    if make and plan.todo():
        keys = {made.step.scene: made.key for made in make(surveys).values() if _is_survey(made)}
    closed = {scene.name: _closed(scene, store, key) for scene in unknown if (key := keys.get(scene.name))}
    notes = tuple(f"{scene.name}: disparities {_told(scene)}, estimated from the images" for scene in closed.values())
    scenes = tuple(closed.get(scene.name, scene) for scene in request.dataset.scenes)
    return replace(request, dataset=Dataset(request.dataset.spec, scenes), notes=(*request.notes, *notes))


def _plain(request: Request) -> dict[str, Config]:
    """Return the configurations of a look at scenes: no network takes part, so no scene is held out."""
    return {
        name: config.model_copy(update={"training": config.training.model_copy(update={"held_out": False})})
        for name, config in request.configs.items()
    }


def _is_survey(each: Planned | Made) -> bool:
    return each.step.product == "survey"


def _told(scene: SceneSource) -> str:
    return f"{scene.disparities.minimum} to {scene.disparities.maximum} px"


def _closed(scene: SceneSource, store: Store, key: str) -> SceneSource:
    """Return the scene with its open ends as its survey estimates them."""
    low, high = np.asarray(store.arrays(key)["range"][...]).tolist()
    edge, known = scene.size[1] - 1, scene.disparities
    usual = min(edge, 127)
    if np.isnan(low):
        raise UsageError(
            f"{scene.name}: too little in the two images agrees to estimate the range of disparities; give both ends, "
            f"as in --min-disp 0 --max-disp {usual} (match) or pair:...,d_min=0,d_max={usual}"
        )
    # What has no texture is not seen by the survey: it may widen a range that is half known, never take 0 out of it.
    least = int(low) if "maximum" in scene.open_ends else min(0, int(low))
    first = max(-edge, least) if "minimum" in scene.open_ends else known.minimum
    last = min(edge, int(high)) if "maximum" in scene.open_ends else known.maximum
    if first > last:
        raise UsageError(
            f"{scene.name}: disparities look like {low:g} to {high:g} px, which leaves nothing of the range that was "
            f"given; give both its ends"
        )
    return replace(scene, disparities=DisparityRange(first, last), open_ends=())
