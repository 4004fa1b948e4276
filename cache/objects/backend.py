"""A cache below the URL of an object store."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from functools import partial
from time import time
from typing import Any

from semidense.cache.entries.backend import Lease, Policy
from semidense.cache.entries.encoded import Encoded
from semidense.cache.entries.entry import Entry, File
from semidense.cache.entries.publish import require_same
from semidense.cache.errors import CacheError, CacheUnavailable, DamagedEntry, EntryNotFound
from semidense.cache.files import in_threads
from semidense.cache.keys.recipe import Recipe
from semidense.cache.keys.sources import source_texts, verified_source
from semidense.cache.layout import require_key
from semidense.cache.objects import names, records
from semidense.cache.objects.draft import ObjectDraft, hold, place_for
from semidense.cache.objects.leases import alive, leased, uses
from semidense.cache.objects.living import Living, owner_of, take
from semidense.cache.objects.requests import Objects, connect

_TAG = b"This prefix is a cache of semidense-stereo: all in it can be made again.\n"


@dataclass(frozen=True)
class ObjectBackend:
    """The cache below a URL; ``Backend`` says what its methods do."""

    url: str

    @property
    def objects(self) -> Objects:
        """The requests to the store; a copy of this in another process makes its own connections."""
        return connect(self.url)

    @property
    def far(self) -> bool:
        """Waiting for an answer takes longer than reading it, see ``Backend``."""
        return True

    def create(self) -> None:
        """Mark the prefix as a cache, see ``Backend``; refuse a store without conditional writes."""
        if not self.objects.is_cache:
            self.objects.require_conditions()
            self.require_cache()
            self.objects.is_cache = self.objects.create(names.TAG, _TAG) is None

    def require_cache(self) -> None:
        """Refuse a prefix with somebody else's objects, see ``Backend``."""
        there = [each for each in self.objects.names() if each != "probe"]
        if there and not ((tag := self.objects.get(names.TAG)) and tag.data == _TAG):
            raise CacheUnavailable(
                f"{self.url} is not a cache: it holds {there[0]!r} but no {names.TAG} of this program; "
                "choose a new or empty prefix"
            )

    def exists(self) -> bool:
        """Return whether the prefix is a cache."""
        return self.objects.head(names.TAG) is not None

    def record_keys(self) -> Iterator[str]:
        """Yield the key of each record, see ``Backend``."""
        return (key for each in self.objects.below("records") if (key := names.key_of_record(each.path)))

    def last_used(self) -> Callable[[str], float]:
        """Return what tells when a run last used a key, or made it; see ``Backend``."""
        made = {names.key_of_record(each.path): each.modified for each in self.objects.below("records")}
        used = uses(self.objects).used
        return lambda key: max(used(key), made.get(key, 0.0))

    def record(self, key: str) -> Entry:
        """Return the entry that a record tells, see ``Backend``."""
        return records.read(self.objects, key).entry

    def has(self, key: str) -> bool:
        """Return whether there is a record, see ``Backend``."""
        return self.objects.head(names.record(key)) is not None

    def compare(self, entry: Entry, policy: Policy) -> None:
        """Do nothing: bytes are compared when they are read, see ``Backend``."""

    def verify(self, key: str) -> Entry:
        """Return an entry after reading every byte of it from the store, see ``Backend``."""
        from semidense.cache.objects.reader import fetch

        record = records.read(self.objects, key)
        try:
            files = records.read_manifest(self.objects, record).files
            in_threads(lambda file: fetch(self.objects, record, file, kept=False), files)
        except DamagedEntry:
            if records.read(self.objects, key) == record:
                raise
            return self.verify(key)  # it was deleted, or made again, meanwhile
        return record.entry

    def set_aside(self, key: str, policy: Policy) -> None:
        """Put a mark in place of a damaged entry's record, see ``Backend``."""
        there = self.objects.get(names.record(key))
        try:
            self.verify(key)
        except DamagedEntry as error:
            if there:
                records.set_aside(self.objects, key, there, str(error))
        except EntryNotFound:
            return  # somebody else set it aside

    def data(self, key: str, policy: Policy) -> tuple[Entry, Any]:
        """Return an entry and the zarr store that fetches its files, see ``Backend``."""
        from semidense.cache.objects.reader import ObjectStore

        record = records.read(self.objects, key)
        manifest = records.read_manifest(self.objects, record)
        return record.entry, ObjectStore(manifest, partial(self._fetch, record))

    def _fetch(self, record: records.Record, file: File) -> bytes:
        """Return the bytes of a file; set the entry aside if they are not those published."""
        from semidense.cache.objects.reader import fetch

        try:
            return fetch(self.objects, record, file)
        except DamagedEntry:
            self.set_aside(record.entry.key, "full")
            raise

    def begin(self, recipe: Recipe, label: Mapping[str, str], lease: Lease | None, maker: str) -> ObjectDraft:
        """Return a draft below a prefix of its own, see ``Backend``."""
        self.create()
        name = (lease and lease.name) or names.new_lease()
        place = place_for(self.objects, name, recipe.key, maker)
        if lease is None and (living := take(self.objects, alive(name))):
            hold(place, living)
        draft = ObjectDraft(recipe, label, time(), self.url, place)
        draft.begin()
        return draft

    def publish_all(self, results: Sequence[Encoded], lease: Lease) -> list[Entry]:
        """Write results and their records, several at a time; see ``Backend``."""

        def publish(result: Encoded) -> Entry:
            draft = self.begin(result.recipe, result.label, lease, result.maker)
            try:
                draft.fill(result.files)
            except BaseException:
                draft.discard()
                raise
            entry = draft.publish(result.seconds, result.extras)
            require_same(entry, result.entry())  # the files may be those of another task of this run, which came first
            return entry

        return in_threads(publish, results)

    def claim(self, key: str) -> Living | None:
        """Return the claim of making a key, see ``Backend``."""
        require_key(key)
        self.create()
        return take(self.objects, f"claims/{key}")

    def claimant(self, key: str) -> str | None:
        """Return who is making a key, see ``Backend``."""
        return owner_of(self.objects.get(f"claims/{require_key(key)}"))

    def lease(self) -> AbstractContextManager[Lease]:
        """Return a context with a lease, see ``Backend``."""
        self.create()
        return leased(self.objects)

    def checkpoint(self, key: str) -> "State":
        """Return the object of the states of long work, see ``Backend``."""
        return State(self.url, f"checkpoints/{require_key(key)}")

    def keep_sources(self, code: Mapping[str, str]) -> None:
        """Create the texts of modules that are not there, see ``Backend``."""
        with suppress(CacheError):
            self.create()
            there = set(self.objects.names("sources"))
            missing = source_texts(code, lambda code_hash: f"{code_hash}.py" in there)
            in_threads(lambda each: self.objects.create(f"sources/{each[0]}.py", each[1].encode()), missing)

    def kept_source(self, code_hash: str) -> str | None:
        """Return a text that was kept, see ``Backend``."""
        with suppress(CacheError):
            found = self.objects.get(f"sources/{require_key(code_hash)}.py")
            return verified_source(code_hash, found.data) if found else None
        return None

    def sweep_drafts(self) -> int:
        """Delete nothing: what dead runs left is found by listing all, which a cleaning does; see ``Backend``."""
        self.require_cache()
        return 0


@dataclass(frozen=True)
class State:
    """An object that is written as a whole, again and again; ``Checkpoint`` says what its methods do."""

    url: str
    path: str

    def save(self, data: bytes) -> None:
        """Replace the object."""
        connect(self.url).put(self.path, data)

    def load(self) -> bytes | None:
        """Return the object's bytes; None if there is none."""
        found = connect(self.url).get(self.path)
        return found.data if found else None

    def remove(self) -> None:
        """Delete the object."""
        connect(self.url).delete([self.path])
