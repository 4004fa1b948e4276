"""What a cleaning may delete, as a user says it, and what it found."""

import time
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from semidense.cache.entries.entry import Entry

Kind = Literal["entry", "draft", "orphan", "old format", "damaged record", "quarantine", "checkpoint", "stale lock"]


@dataclass(frozen=True)
class Limits:
    """Which sound entries may go; the leftovers of crashes always may.

    Attributes:
        keep: keys that stay whatever their age, such as those that a configuration reaches; None: no entry is
            deleted for being unreachable, and age and size alone decide.
        seconds: entries unused for longer may go; None: age does not matter.
        bytes: entries go, longest unused first, until no more is left; None: size does not matter.
        useless: keys of entries that can never be used again, with the reason: these go whatever else is asked for.
    """

    keep: frozenset[str] | None = None
    seconds: float | None = None
    bytes: int | None = None
    useless: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Item:
    """Something that can be deleted.

    Attributes:
        kind: what it is.
        name: the key of an entry, the name of anything else.
        reason: why it can go, in a few words.
        size: bytes on disk.
        paths: what is deleted of a folder; what makes it visible comes first.
        entry: of an entry, what its record tells.
    """

    kind: Kind
    name: str
    reason: str
    size: int
    paths: tuple[Path, ...]
    entry: Entry | None = None


@dataclass(frozen=True)
class Survey:
    """What can be deleted, and what else is there.

    Attributes:
        items: what can go.
        kept: how many entries stay.
        kept_bytes: their size.
        used: how many of those stay only since a running process uses them.
    """

    items: tuple[Item, ...]
    kept: int
    kept_bytes: int
    used: int


def chosen(entries: Collection[Entry], limits: Limits, last_used: Callable[[str], float]) -> Iterator[tuple[str, str]]:
    """Yield the key of each entry that may go, with the reason, longest unused first."""
    yield from ((entry.key, limits.useless[entry.key]) for entry in entries if entry.key in limits.useless)
    if limits.keep is None and limits.seconds is None and limits.bytes is None:
        return
    now, entries = time.time(), [entry for entry in entries if entry.key not in limits.useless]
    left = sum(entry.size for entry in entries)
    free = [entry for entry in entries if limits.keep is None or entry.key not in limits.keep]
    unreachable = "not reached by what is to be kept; " if limits.keep is not None else ""
    for used, entry in sorted(((last_used(each.key), each) for each in free), key=lambda pair: pair[0]):
        old = limits.seconds is not None and now - used > limits.seconds
        over = limits.bytes is not None and left > limits.bytes
        if old or over or limits.seconds is limits.bytes is None:
            left -= entry.size
            why = "unused for long" if old else "the cache is too large" if over else ""
            yield entry.key, f"{unreachable}{why}".removesuffix("; ")
