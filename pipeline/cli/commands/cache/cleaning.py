"""Clean a cache: show what can go and why, and delete it when asked to."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from semidense.cache import Entry
from semidense.cache.upkeep.gc import collect, survey
from semidense.cache.upkeep.limits import Item, Limits, Survey
from semidense.pipeline.api import Task, open_store
from semidense.pipeline.cli.console import print_json
from semidense.pipeline.cli.options import chosen_preset, config_file
from semidense.pipeline.plan.building import build
from semidense.pipeline.plan.environment import former_version
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.plan import close_ranges
from semidense.pipeline.plan.steps import Graph, Step
from semidense.pipeline.results.text import bytes_text, counted, print_table, results

_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 7 * 86400.0}
_BYTES = {"B": 1, "kB": 10**3, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}
_NUMBER = re.compile(r"(\d+(?:\.\d+)?)\s*([A-Za-z]+)", re.ASCII)
Label = tuple[tuple[str, str], ...]
SHOWN = 40
"""Lines of a list of things to delete; more are counted."""


@dataclass(frozen=True)
class Wish:
    """What a user asks to be cleaned: the arguments of ``cache gc``."""

    keep: tuple[str, ...] = ()
    configs: tuple[Path, ...] = ()
    presets: tuple[str, ...] = ()
    train: bool = False
    unused_for: str | None = None
    max_size: str | None = None

    def limits(self, folder: str | None) -> Limits:
        """Return what that means for the entries of a cache.

        Raises:
            UsageError, DatasetError: if a dataset, a configuration, an age or a size is none.
        """
        if (self.configs or self.presets or self.train) and not self.keep:
            raise UsageError("--config, --preset and --train say how a dataset is kept: name it with --keep DATASET")
        seconds = _amount(self.unused_for, _UNITS, "--unused-for", "30d, 12h, 5min")
        largest = _amount(self.max_size, _BYTES, "--max-size", "20GB, 500MB")
        entries = list(open_store(folder).entries())
        reached = frozenset(self._reached(folder, entries)) if self.keep else None
        return Limits(reached, seconds, None if largest is None else int(largest), _useless(entries))

    def _reached(self, folder: str | None, entries: Sequence[Entry]) -> Iterator[str]:
        """Yield the keys that the datasets reach, each with each configuration and each preset."""
        store, by_label = open_store(folder), dict[Label, list[Entry]]()
        for entry in entries:
            by_label.setdefault(_label(entry.label), []).append(entry)
        digests = {entry.key: entry.digest for entry in entries}
        for dataset, config in product(self.keep, self.configs or (config_file(None),)):
            for preset in self.presets or (chosen_preset(None, config),):
                request = Task(dataset, config=config, train=self.train, preset=preset).request("metrics")
                yield from _keys(build(close_ranges(request, store)), digests, by_label)


def _label(label: Mapping[str, str]) -> Label:
    return tuple(sorted(label.items()))


def _keys(graph: Graph, digests: Mapping[str, str], by_label: Mapping[Label, Sequence[Entry]]) -> Iterator[str]:
    """Yield the keys that steps have by what the records say; of a step that lacks an input, all that it may have.

    No data are read: those of a damaged entry will be made again, with the digest that its record tells.
    """
    known: dict[str, str] = {}
    for step in graph.steps.values():
        if not all(each in known for ids in step.inputs.values() for each in ids):
            yield from _possible(by_label.get(_label(step.label), ()), step)
            continue
        yield (key := step.recipe(known).key)
        if key in digests:
            known[step.id] = digests[key]


def _useless(entries: Iterable[Entry]) -> dict[str, str]:
    """Return the entries that another version made and this one cannot use, with the reason."""
    versions = {entry.key: former_version(entry) for entry in entries}
    return {key: f"made by version {version}, whose code is gone" for key, version in versions.items() if version}


def _possible(entries: Iterable[Entry], step: Step) -> Iterator[str]:
    """Yield the entries that a step may still find, as long as its inputs are missing."""
    for entry in entries:
        same = (entry.recipe.code, entry.recipe.params, entry.recipe.environment)
        if same == (step.code, step.settings, step.environment):
            yield entry.key


def _amount(text: str | None, units: dict[str, float] | dict[str, int], option: str, examples: str) -> float | None:
    if text is None:
        return None
    match = _NUMBER.fullmatch(text.strip())
    if match is None or match[2] not in units:
        raise UsageError(f"{option} {text!r}: write a number and a unit, such as {examples}")
    return float(match[1]) * units[match[2]]


def clean(folder: str | None, wish: Wish, *, yes: bool, as_json: bool) -> None:
    """Print what can be deleted and why; delete it if ``yes``."""
    store = open_store(folder)
    found = survey(store, wish.limits(folder))
    deleted = collect(store, found.items) if yes and found.items else ()
    if as_json:
        rows = [
            {
                "kind": item.kind,
                "name": item.name,
                "reason": item.reason,
                "bytes": item.size,
                "deleted": item in deleted,
            }
            for item in found.items
        ]
        print_json({"items": rows, "kept": found.kept, "kept_bytes": found.kept_bytes, "in_use": found.used})
        return
    _print_items(found.items)
    _print_summary(found, deleted, yes)


def _print_items(items: tuple[Item, ...]) -> None:
    table = Table("what", "product", "scene", "size", "name", "why", box=None)
    table.columns[3].justify = "right"
    for item in items[:SHOWN]:
        label = item.entry.label if item.entry else {}
        names = [escape(label.get(name, "")) for name in ("product", "scene")]
        table.add_row(item.kind, *names, bytes_text(item.size), escape(item.name[:12]), escape(item.reason))
    if items:
        print_table(table, results(), ("name", "what", "scene"))
    if len(items) > SHOWN:
        results().print(f"and {len(items) - SHOWN} more; --json lists all")


def _print_summary(found: Survey, deleted: tuple[Item, ...], yes: bool) -> None:
    console = results()
    items = deleted if yes else found.items
    size = bytes_text(sum(item.size for item in items))
    kept = f"keeps {counted(found.kept, 'entry', 'entries')}, {bytes_text(found.kept_bytes)}"
    used = f", {found.used} of them only since a running process uses them" if found.used else ""
    if not found.items:
        console.print(f"nothing to delete; {kept}{used}")
    elif yes:
        console.print(f"deleted {counted(len(items), 'thing')}, {size}; {kept}{used}")
    else:
        console.print(f"would delete {counted(len(items), 'thing')}, {size}; {kept}{used}")
        console.print("nothing was deleted: add --yes for that")
