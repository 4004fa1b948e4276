"""The records of entries: read, published and set aside, each by one conditional request."""

import logging
from dataclasses import dataclass
from functools import lru_cache

from semidense.cache.document import seal, unseal
from semidense.cache.entries.entry import MANIFEST, Entry, Manifest
from semidense.cache.entries.publish import require_same
from semidense.cache.errors import DamagedEntry, EntryNotFound
from semidense.cache.objects import names
from semidense.cache.objects.requests import Found, Objects

_log = logging.getLogger("semidense.cache")
_entry = lru_cache(2048)(Entry.from_bytes)
_manifest = lru_cache(256)(Manifest.from_bytes)


@dataclass(frozen=True)
class Record:
    """What the object of a record says: an entry and the place of its data."""

    entry: Entry
    place: str

    def to_bytes(self) -> bytes:
        """Return the object: the record as a folder has it, and the place."""
        return seal("placed entry", {"place": self.place, "record": self.entry.to_bytes().decode("ascii")})


@dataclass(frozen=True)
class Aside:
    """What stands in place of a damaged entry's record until the entry is made again."""

    place: str
    reason: str

    def to_bytes(self) -> bytes:
        """Return the object."""
        return seal("set aside", {"place": self.place, "reason": self.reason})


def parse(key: str, data: bytes) -> Record:
    """Read the object of a record.

    Raises:
        EntryNotFound: if the entry was set aside.
        DamagedEntry: if one byte differs from what was written.
    """
    try:
        content = unseal("placed entry", data)
        place, text = content["place"], content["record"]
        if not names.is_place(place) or set(content) != {"place", "record"} or not isinstance(text, str):
            raise ValueError("it names no place, or has no record")
        return Record(_entry(key, text.encode("ascii")), place)
    except (ValueError, KeyError) as error:
        if aside := parse_aside(data):
            raise EntryNotFound(f"the entry {key} was set aside: {aside.reason}") from None
        raise DamagedEntry(f"the record of {key} is damaged: {error}") from None


def parse_aside(data: bytes) -> Aside | None:
    """Return what stands in place of a damaged entry; None for any other object."""
    try:
        content = unseal("set aside", data)
        return Aside(str(content["place"]), str(content["reason"]))
    except (ValueError, KeyError):
        return None


def read(objects: Objects, key: str) -> Record:
    """Return the record of ``key``.

    Raises:
        EntryNotFound: if there is none.
        DamagedEntry: if it is not what was written.
        CacheUnavailable: if the store refuses.
    """
    found = objects.get(names.record(key))
    if found is None:
        raise EntryNotFound(f"no entry has the key {key} in {objects.url}")
    return parse(key, found.data)


def read_manifest(objects: Objects, record: Record) -> Manifest:
    """Return the manifest of an entry.

    Raises:
        DamagedEntry: if it is missing, or not the one that the record tells.
        CacheUnavailable: if the store refuses.
    """
    entry = record.entry
    found = objects.get(f"data/{record.place}/{MANIFEST}")
    if found is None:
        raise DamagedEntry(f"the entry {entry.key} is damaged: its manifest is missing")
    manifest = _manifest(found.data)
    if (manifest.digest, manifest.size) != (entry.digest, entry.size):
        raise DamagedEntry(f"the entry {entry.key} is damaged: its manifest is not the one that its record tells")
    return manifest


def publish(objects: Objects, mine: Record) -> Record:
    """Write a record where there is none, or none that is sound; return the one that is there then.

    Raises:
        NonDeterministicStage: if another writer published other content under this key.
        CacheUnavailable: if the store refuses.
    """
    key = mine.entry.key
    while there := objects.create(names.record(key), mine.to_bytes()):
        try:
            record = parse(key, there.data)
            read_manifest(objects, record)
        except (EntryNotFound, DamagedEntry):
            if objects.replace(names.record(key), mine.to_bytes(), there):
                break
        else:
            require_same(record.entry, mine.entry)
            return record
    return mine


def set_aside(objects: Objects, key: str, there: Found, reason: str) -> None:
    """Put a mark in place of a record, unless it was replaced since it was found damaged."""
    if parse_aside(there.data):
        return
    try:
        place = parse(key, there.data).place
    except DamagedEntry:
        place = ""
    if objects.replace(names.record(key), Aside(place, reason).to_bytes(), there):
        _log.warning("%s; it was set aside in %s and will be made again", reason, objects.url)
