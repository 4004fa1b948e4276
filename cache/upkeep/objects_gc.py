"""Clean a cache in an object store: never what a living run uses.

There are no renames and no locks here. A cleaning says first which keys it will delete, and then reads what runs use;
a run says first what it uses, and then reads what a cleaning deletes (see ``objects/leases.py``). Data without a record
are deleted only when they are old by the store's clock and their run is dead: their writer may be about to publish.
"""

import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

from semidense.cache.entries.entry import Entry
from semidense.cache.errors import CacheUnavailable, DamagedEntry
from semidense.cache.files import in_threads
from semidense.cache.objects import names, records
from semidense.cache.objects.draft import discard
from semidense.cache.objects.leases import Uses, uses
from semidense.cache.objects.living import BEAT, EXPIRY, Living, take
from semidense.cache.objects.requests import Listed, Objects
from semidense.cache.upkeep.limits import Item, Kind, Limits, Survey, chosen

ORPHAN_SECONDS = 24 * 3600.0
"""Age from which on data without a record are those of a writer that was killed."""


@dataclass
class _Place:
    """The data at one place: their bytes, and when the last of them were written."""

    size: int = 0
    modified: float = 0.0


@dataclass
class _View:
    """All that a cache holds, as far as a cleaning looks at it."""

    objects: Objects
    now: float
    uses: Uses
    entries: dict[str, Entry] = field(default_factory=dict)
    made: dict[str, float] = field(default_factory=dict)
    asides: dict[str, records.Aside] = field(default_factory=dict)
    damaged: list[Listed] = field(default_factory=list)
    referred: set[str] = field(default_factory=set)
    places: dict[str, _Place] = field(default_factory=dict)

    def last_used(self, key: str) -> float:
        """Return when an entry was made or last used, by the store's clock."""
        return max(self.uses.used(key), self.made.get(key, 0.0))


def view(objects: Objects) -> _View:
    """Return all that a cache holds; records are read, data are listed.

    Raises:
        CacheUnavailable: if the store refuses.
    """
    # Data first: a place that has a record by the time that records are read is no orphan.
    found = _View(objects, objects.now(), uses(objects), places=_places(objects))
    listed = [each for each in objects.below("records") if names.key_of_record(each.path)]
    for each, there in zip(listed, in_threads(lambda each: objects.get(each.path), listed), strict=True):
        if there:
            _sort(found, str(names.key_of_record(each.path)), each, there.data)
    return found


def _places(objects: Objects) -> dict[str, _Place]:
    places: dict[str, _Place] = {}
    for each in objects.below("data"):
        place = places.setdefault("/".join(each.path.split("/")[1:3]), _Place())
        place.size += each.size
        place.modified = max(place.modified, each.modified)
    return places


def _sort(found: _View, key: str, listed: Listed, data: bytes) -> None:
    """Note what a record says."""
    there = _read(key, data)
    if isinstance(there, DamagedEntry):
        found.damaged.append(listed)
        return
    found.referred.add(there.place)
    if isinstance(there, records.Aside):
        found.asides[key] = there
    else:
        found.entries[key], found.made[key] = there.entry, listed.modified


def survey(objects: Objects, limits: Limits) -> Survey:
    """Return what can be deleted; nothing is changed. See ``gc.survey``."""
    found = view(objects)
    wanted = dict(chosen(found.entries.values(), limits, found.last_used))
    going = {key: reason for key, reason in wanted.items() if key not in found.uses.keys}
    items = [_item("entry", key, reason, found.entries[key].size, found.entries[key]) for key, reason in going.items()]
    kept = [entry for key, entry in found.entries.items() if key not in going]
    items += _leftovers(found)
    return Survey(tuple(items), len(kept), sum(entry.size for entry in kept), len(wanted) - len(going))


def _item(kind: Kind, name: str, reason: str, size: int, entry: Entry | None = None) -> Item:
    return Item(kind, name, reason, size, (), entry)


def _leftovers(found: _View) -> Iterator[Item]:
    """Yield what crashes and damage left."""
    for each in found.damaged:
        yield _item("damaged record", str(names.key_of_record(each.path)), "its record cannot be read", each.size)
    for key, aside in found.asides.items():
        size = found.places.get(aside.place, _Place()).size
        yield _item("quarantine", key, "damaged, and made again when it is needed", size)
    drafts = {each.path.removeprefix("drafts/") for each in found.objects.below("drafts")}
    for place in sorted(drafts):
        if _lease(place) not in found.uses.living:
            yield _item("draft", place, "its run is gone", found.places.get(place, _Place()).size)
    for place, data in sorted(found.places.items()):
        if place not in found.referred | drafts and _is_old(found, place, data.modified):
            yield _item("orphan", place, "data without a record: its writer was killed", data.size)
    for each in found.objects.below("checkpoints"):
        key = each.path.rpartition("/")[2]
        if key in found.entries and key not in found.uses.keys:
            yield _item("checkpoint", key, "its product is there", each.size)
    yield from _stale(found)


def _is_old(found: _View, place: str, modified: float) -> bool:
    return _lease(place) not in found.uses.living and found.now - modified > ORPHAN_SECONDS


def _lease(place: str) -> str:
    return place.partition("/")[0]


def _stale(found: _View) -> Iterator[Item]:
    """Yield signs of life of dead processes, and the lists of dead runs on which nothing is that is still there."""
    claims = (each for each in found.objects.below("claims") if found.now - each.modified > EXPIRY)
    for each in (*claims, *found.uses.dead):
        yield _item("stale lock", each.path, "its process is gone", each.size)
    for each in found.objects.below("probe"):
        if found.now - each.modified > ORPHAN_SECONDS:
            yield _item("stale lock", each.path, "its process was killed while it tried the store", each.size)
    for each, keys in found.uses.lists:
        if each.path.split("/")[1] not in found.uses.living and not keys & found.entries.keys():
            yield _item("stale lock", each.path, "its run is gone, and so is what it used", each.size)


def collect(objects: Objects, items: Collection[Item]) -> tuple[Item, ...]:
    """Delete what ``survey`` found, except what a run has begun to use since. See ``gc.collect``."""
    if not items:  # this may be a prefix without a tag as yet: the mark of a cleaning would make it look foreign
        return ()
    cleaning = take(objects, names.CLEANING, {"keys": sorted(item.name for item in items if item.kind in _RECORDS)})
    if cleaning is None:
        raise CacheUnavailable(f"somebody else is cleaning {objects.url}: wait until that is done")
    try:
        used = uses(objects)
        free = [item for item in items if item.name not in used.keys and not _is_of_living(item, used)]
        return tuple(_deleted(objects, cleaning, free))
    finally:
        cleaning.release()


_RECORDS: dict[Kind, type] = {"entry": records.Record, "quarantine": records.Aside, "damaged record": DamagedEntry}
"""The kinds of items that are records, and what the object of each is."""


def _is_of_living(item: Item, used: Uses) -> bool:
    """Return whether a draft, an orphan or a list belongs to a run that came back to life since the survey."""
    lease = item.name.split("/")[1] if item.name.startswith("leases/") else _lease(item.name)
    return item.kind not in _RECORDS and lease in used.living


def _deleted(objects: Objects, cleaning: Living, items: Collection[Item]) -> Iterator[Item]:
    """Delete things one by one, as long as the mark of the cleaning is known to be alive; yield each that was there."""
    renewed = time.monotonic()
    for item in items:
        if time.monotonic() - renewed > BEAT:
            if not cleaning.renew():
                raise CacheUnavailable(f"this cleaning of {objects.url} was taken for dead: clean again")
            renewed = time.monotonic()
        if _delete(objects, item):
            yield item


def _delete(objects: Objects, item: Item) -> bool:
    """Delete a thing; return whether it still was what the survey found."""
    if item.kind in _RECORDS:
        return _delete_record(objects, item.name, _RECORDS[item.kind])
    if item.kind == "draft":
        discard(objects, item.name)
    elif item.kind == "orphan":
        _delete_data(objects, item.name)
    elif item.kind == "checkpoint":
        objects.delete([f"checkpoints/{item.name}"])
    elif item.name.startswith("claims/") or item.name.endswith("/alive"):
        return _delete_sign(objects, item.name)
    else:
        objects.delete([item.name])
    return True


def _delete_sign(objects: Objects, path: str) -> bool:
    """Delete the sign of life of a dead process; leave it if somebody has taken it over, or lives after all."""
    taken = take(objects, path)
    if taken:
        taken.release()
    return taken is not None


def _delete_record(objects: Objects, key: str, kind: type) -> bool:
    """Delete a record, then its data: killed in between, this leaves data without a record, which nobody sees."""
    found = objects.get(names.record(key))
    if found is None or not isinstance(there := _read(key, found.data), kind):
        return False
    objects.delete([names.record(key)])
    place = getattr(there, "place", "")
    if names.is_place(place):
        _delete_data(objects, place)
    return True


def _read(key: str, data: bytes) -> records.Record | records.Aside | DamagedEntry:
    """Return what the object of a record is: a record, what stands in place of one, or why it cannot be read."""
    try:
        return records.parse_aside(data) or records.parse(key, data)
    except DamagedEntry as error:
        return error


def _delete_data(objects: Objects, place: str) -> None:
    objects.delete(each.path for each in objects.below(f"data/{place}"))
