"""Find what can be deleted and why, and delete it: never what a running process uses.

``survey`` only looks. ``collect`` looks at each thing again, moves it out of sight by a rename, and then deletes it;
killed in between, it leaves a draft of a dead process, which the next run sweeps.
"""

import json
import os
from collections.abc import Container, Iterable, Iterator
from pathlib import Path

from semidense.cache.document import FORMAT_VERSION
from semidense.cache.entries.check import read_plain
from semidense.cache.entries.entry import Entry
from semidense.cache.entries.quarantine import move_anything
from semidense.cache.errors import CacheUnavailable
from semidense.cache.files import make_folder, remove, walk, writing
from semidense.cache.layout import Layout
from semidense.cache.objects.requests import connect
from semidense.cache.processes.lease import FolderLease, cleaning, in_use, is_abandoned, leased, remove_stale
from semidense.cache.processes.locks import held, is_held
from semidense.cache.store import Store
from semidense.cache.upkeep import objects_gc
from semidense.cache.upkeep.limits import Item, Kind, Limits, Survey, chosen


def survey(store: Store, limits: Limits) -> Survey:
    """Return what can be deleted; nothing is changed.

    Raises:
        CacheUnavailable: if this is not a cache, or its place refuses.
    """
    store.backend.require_cache()
    if isinstance(store.root, str):
        return objects_gc.survey(connect(store.root), limits)
    layout, used = store.layout, in_use(store.layout)
    entries = {entry.key: entry for entry in store.entries()}
    wanted = dict(chosen(entries.values(), limits, store.last_used()))
    going = {key: reason for key, reason in wanted.items() if key not in used}
    items = [_entry_item(layout, entries[key], reason) for key, reason in going.items()]
    kept = [entry for key, entry in entries.items() if key not in going]
    items += _leftovers(layout, entries.keys(), used)
    return Survey(tuple(items), len(kept), sum(entry.size for entry in kept), len(wanted) - len(going))


def _entry_item(layout: Layout, entry: Entry, reason: str) -> Item:
    paths = (layout.record(entry.key), layout.entry(entry.key))
    return Item("entry", entry.key, reason, entry.size, paths, entry)


def _leftovers(layout: Layout, sound: Iterable[str], used: Container[str]) -> Iterator[Item]:
    """Yield what crashes, damage and older formats left."""
    entries = set(sound)
    broken = {key: _unreadable(layout, key) for key in layout.record_keys() if key not in entries}
    yield from (item for item in broken.values() if item)
    for key in layout.entry_keys():
        if key not in entries and key not in broken:
            yield _item("orphan", key, "data without a record: its writer was killed", layout.entry(key))
    for path in layout.things(layout.drafts):
        if is_abandoned(layout, path):
            yield _item("draft", path.name, "its run is gone", path)
    for path in layout.things(layout.quarantine):
        yield _item("quarantine", path.name, "damaged, and made again when it is needed", path)
    for path in layout.things(layout.checkpoints):
        key = path.name.removeprefix(".")[:64]  # of a half-written one too
        if key not in used and (key in entries or path.name.startswith(".")):
            yield _item("checkpoint", key, "its product is there, or its writer was killed", path)
    for path in (*layout.things(layout.locks), *layout.things(layout.leases)):
        if not is_held(path):
            yield _item("stale lock", path.name, "its process is gone", path)


def _unreadable(layout: Layout, key: str) -> Item | None:
    """Return a record that is not well-formed as an item; None for one of a newer format, which is not ours."""
    path = layout.record(key)
    try:
        version = json.loads(read_plain(path))["format"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        version = None
    newer = type(version) is int and version > FORMAT_VERSION
    older = type(version) is int and version < FORMAT_VERSION
    kind: Kind = "old format" if older else "damaged record"
    reason = f"of format {version}, this program reads {FORMAT_VERSION}" if older else "its record cannot be read"
    return None if newer else _item(kind, key, reason, path, layout.entry(key))


def _item(kind: Kind, name: str, reason: str, *paths: Path) -> Item:
    return Item(kind, name, reason, sum(map(_bytes, paths)), paths)


def _bytes(path: Path) -> int:
    try:
        if path.is_symlink() or not path.is_dir():
            return path.lstat().st_size
        return sum(
            thing.stat(follow_symlinks=False).st_size
            for _, thing in walk(path)
            if not thing.is_dir(follow_symlinks=False)
        )
    except OSError:
        return 0


def collect(store: Store, items: Iterable[Item]) -> tuple[Item, ...]:
    """Delete what ``survey`` found, except what a process has begun to use since; return what was deleted.

    Raises:
        CacheUnavailable: if this is not a cache, or its place refuses; what was deleted by then stays deleted.
    """
    store.backend.require_cache()
    items = tuple(items)
    if isinstance(store.root, str):
        return objects_gc.collect(connect(store.root), items)
    layout = store.layout
    with leased(layout) as lease:
        done = _delete(layout, lease, [item for item in items if item.kind != "stale lock"])
    done += [item for item in items if item.kind == "stale lock" and remove_stale(layout, item.paths[0])]
    return tuple(done)


def _delete(layout: Layout, lease: FolderLease, items: Iterable[Item]) -> list[Item]:
    """Move things out of sight and delete them; return those that nobody uses and that were still there."""
    trash = layout.new_draft(lease.name or "0" * 32)
    try:
        with writing(layout.root):
            make_folder(trash)
        with cleaning(layout):
            used = in_use(layout)
            return [
                item
                for number, item in enumerate(items)
                if item.name not in used and _move_away(layout, item, trash / str(number))
            ]
    finally:
        remove(trash)


def _move_away(layout: Layout, item: Item, target: Path) -> bool:
    """Rename an item's paths to where nobody sees them; return whether there was still anything to move."""
    if item.kind in ("draft", "quarantine", "checkpoint"):
        return _rename_all(item, target)
    with held(layout.lock("commit", item.name)):
        return _is_still(layout, item) and _rename_all(item, target)


def _is_still(layout: Layout, item: Item) -> bool:
    """Return whether a record, or its absence, is what the survey found: a writer may have come since."""
    if item.kind == "orphan":
        return not os.path.lexists(layout.record(item.name))
    if item.kind == "entry":
        return True
    return (found := _unreadable(layout, item.name)) is not None and found.kind == item.kind


def _rename_all(item: Item, target: Path) -> bool:
    moved = False
    for number, path in enumerate(item.paths):
        try:
            move_anything(path, target.with_name(f"{target.name}-{number}"))
            moved = True
        except FileNotFoundError:
            continue
        except OSError as error:
            raise CacheUnavailable(f"cannot delete {path} from the cache: {error.strerror or error}") from error
    return moved
