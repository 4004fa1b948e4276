"""Estimate how long a plan will take and how much it will write, from results in the cache that this machine made."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any, TypeVar

from semidense.cache import Entry, Store
from semidense.cache.document import canonical
from semidense.cache.entries.index import Index, inputs_of
from semidense.pipeline.plan.environment import cpu_name
from semidense.pipeline.plan.plan import Plan
from semidense.pipeline.plan.steps import Step
from semidense.stages.catalog import READ

_RANGE = ("d_min", "d_max")
T = TypeVar("T", int, float)


@dataclass(frozen=True)
class Estimate:
    """How long a plan will take.

    Attributes:
        known: seconds for the products that have a measured time.
        unknown: products to make without one: nothing like them was made on this machine.
    """

    known: float = 0.0
    unknown: tuple[str, ...] = ()

    @property
    def seconds(self) -> float | None:
        """The time for all products in seconds; None if one of them is unknown."""
        return None if self.unknown else self.known

    def __str__(self) -> str:
        """Return the time in words, and which products it leaves out."""
        if not self.unknown:
            return duration(self.known)
        reason = "nothing like it was made here yet"
        if self.known < 1:
            return f"unknown: {reason}"
        return f"{duration(self.known)}, and an unknown time for {', '.join(self.unknown)}: {reason}"


def duration(seconds: float) -> str:
    """Return a time that is not exact, in words.

    >>> duration(0.4), duration(43), duration(170), duration(9000)
    ('less than 1 s', 'about 43 s', 'about 3 min', 'about 2.5 h')
    """
    if seconds < 1:
        return "less than 1 s"
    for unit, length, most in (("s", 1, 90), ("min", 60, 90)):
        if seconds / length < most:
            return f"about {seconds / length:.0f} {unit}"
    return f"about {seconds / 3600:.1f} h"


@dataclass(frozen=True)
class Part:
    """All that is to be made of one product.

    Attributes:
        product: its name.
        results: how many are to be made, such as one a scene.
        tasks: which workers carry out at the same time: one a tile.
        bytes: of its arrays before compression; where that is not known beforehand, of the files of results like
            it; None if there are none either.
        seconds: on this machine, one result after the other; None if one of them is unknown.
        work: the same on one thread, where each tile of a result takes as long as the others.
        longest: seconds of the longest task on one thread.
    """

    product: str
    results: int
    tasks: int
    bytes: int | None
    seconds: float | None
    work: float
    longest: float

    def seconds_on(self, workers: int) -> float | None:
        """Return the time on so many workers of one thread each, as fast as one of this machine; None if unknown."""
        return None if self.seconds is None else max(self.work / workers, self.longest)


def estimate_parts(plan: Plan, store: Store) -> tuple[Part, ...]:
    """Return what the products of a plan that are not cached will take, product by product in the order of the plan.

    A product of a scene takes the time of a cached one of the same product and mode, times the ratio of pixels x
    disparities. A product of the training split takes the time of one with equal settings. Reading files is not
    counted. What other products make at the same time is not subtracted.
    """
    if not plan.todo():
        return ()
    measured, disparities = _Measured(store.entries()), _planned_disparities(plan)
    steps: dict[str, list[Step]] = {}
    for step in (planned.step for planned in plan.todo()):
        steps.setdefault(step.product, []).append(step)
    return tuple(_part(each, measured, disparities) for each in steps.values())


def _part(steps: Sequence[Step], measured: "_Measured", disparities: Mapping[str, int]) -> Part:
    """Return what the steps of one product take."""
    tiles = [step.tiles for step in steps]
    times = [0.0 if each.product in READ else measured.seconds(each, disparities[each.id]) for each in steps]
    sizes = [measured.bytes(step) for step in steps]
    # A measured time is of as many of this machine's threads as the result has tiles for.
    work = [(time or 0.0) * min(os.cpu_count() or 1, count) for time, count in zip(times, tiles, strict=True)]
    longest = max(each / count for each, count in zip(work, tiles, strict=True))
    return Part(steps[0].product, len(steps), sum(tiles), _sum(sizes), _sum(times), sum(work), longest)


def _sum(values: Sequence[T | None]) -> T | None:
    """Return the sum; None if a value is unknown."""
    known = [value for value in values if value is not None]
    return sum(known[1:], known[0]) if len(known) == len(values) else None


def in_all(parts: Iterable[Part], workers: int | None = None) -> Estimate:
    """Return the time of all parts, one after the other: on so many workers, or None: as this machine measured."""
    times = [(each.product, each.seconds_on(workers) if workers else each.seconds) for each in parts]
    unknown = tuple(product for product, seconds in times if seconds is None)
    return Estimate(sum(seconds or 0.0 for _, seconds in times), unknown)


def estimate(plan: Plan, store: Store) -> Estimate:
    """Return how long the products of a plan that are not cached will take on this machine."""
    return in_all(estimate_parts(plan, store))


class _Measured:
    """The times of the entries that this machine made."""

    def __init__(self, entries: Iterable[Entry]) -> None:
        all_entries = sorted(entries, key=lambda entry: entry.created, reverse=True)
        self._index = Index(all_entries)
        self._entries: dict[str, list[Entry]] = {}
        self._disparities: dict[str, int] = {}
        self._nearest: dict[tuple[str, str], Entry | None] = {}
        for entry in all_entries:
            if entry.extras.get("cpu") == cpu_name():
                self._entries.setdefault(entry.recipe.stage, []).append(entry)

    def seconds(self, step: Step, disparities: int) -> float | None:
        """Return how long a step takes by the entry nearest to it in settings, the newest of equals; None without."""
        if (nearest := self._nearest_to(step)) is None:
            return None
        if step.size is None:
            return nearest.seconds
        return nearest.seconds * prod(step.size) * disparities / (_pixels(nearest) * self._searched(nearest))

    def bytes(self, step: Step) -> int | None:
        """Return how many bytes a step's arrays will have, see ``Part``."""
        nearest = self._nearest_to(step) if step.declared_bytes is None else None
        return nearest.size if nearest else step.declared_bytes

    def _nearest_to(self, step: Step) -> Entry | None:
        """Return the entry nearest to a step; looked for once for all scenes, which differ in their range alone."""
        settings = {name: value for name, value in step.settings.items() if name not in _RANGE}
        asked = step.product, canonical(settings)
        if asked not in self._nearest:
            alike = [entry for entry in self._entries.get(step.product, ()) if _alike(entry, step)]
            self._nearest[asked] = min(alike, key=lambda entry: len(_differing(entry, step)), default=None)
        return self._nearest[asked]

    def _searched(self, entry: Entry) -> int:
        """Return how many disparities an entry, or one of its inputs, has searched; 1 if none did."""
        if entry.key not in self._disparities:
            self._disparities[entry.key] = 1  # before its inputs': a hostile record may name itself
            pairs = [(product, each) for product, all_ in inputs_of(entry.recipe).items() for each in all_]
            above = [found for product, each in pairs if (found := self._index.find(product, each))]
            self._disparities[entry.key] = _count(entry.recipe.params) or max(map(self._searched, above), default=1)
        return self._disparities[entry.key]


def _planned_disparities(plan: Plan) -> dict[str, int]:
    """Return how many disparities each step, or one of its inputs, searches; 1 if none does."""
    found: dict[str, int] = {}
    for step in (planned.step for planned in plan.steps):
        above = (found[each] for ids in step.inputs.values() for each in ids)
        found[step.id] = _count(step.settings) or max(above, default=1)
    return found


def _count(settings: Mapping[str, Any]) -> int | None:
    low, high = (settings.get(name) for name in _RANGE)
    return high - low + 1 if isinstance(low, int) and isinstance(high, int) else None


def _alike(entry: Entry, step: Step) -> bool:
    if step.size is None:
        return not _differing(entry, step)
    by_it = step.stage.module in entry.recipe.code  # another stage may make the product, which ``use`` names
    return by_it and _pixels(entry) > 0 and entry.recipe.params.get("mode") == step.settings.get("mode")


def _differing(entry: Entry, step: Step) -> list[str]:
    """Return the settings in which an entry and a step differ, except for the range of disparities."""
    old, new = entry.recipe.params, step.settings
    return [name for name in {*old, *new} - {*_RANGE} if old.get(name) != new.get(name)]


def _pixels(entry: Entry) -> int:
    """Return the pixels of an entry's image; 0 where they were not recorded."""
    return prod(entry.extras.get("image_size") or (0,))
