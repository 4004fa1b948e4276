"""A cache in a folder, shared by processes and machines that see it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from time import time
from typing import Any

from semidense.cache.entries import publish
from semidense.cache.entries.backend import Lease, Policy
from semidense.cache.entries.check import inspect, inspect_data, read_record
from semidense.cache.entries.draft import FolderDraft, hold
from semidense.cache.entries.encoded import Encoded
from semidense.cache.entries.entry import DATA, Entry
from semidense.cache.entries.quarantine import set_aside_if_damaged
from semidense.cache.errors import CacheUnavailable
from semidense.cache.files import StateFile, add_folder, remove, writing
from semidense.cache.keys.recipe import Recipe
from semidense.cache.keys.sources import keep_sources, kept_source
from semidense.cache.layout import Layout
from semidense.cache.processes.lease import is_abandoned, leased, sweep_checkpoints, sweep_locks, take_lease
from semidense.cache.processes.locks import Lock, holder, try_lock


@dataclass(frozen=True)
class FolderBackend:
    """The cache in the folder of a layout; ``Backend`` says what its methods do."""

    layout: Layout

    @property
    def far(self) -> bool:
        """Reading takes longer than waiting for it, see ``Backend``."""
        return False

    def create(self) -> None:
        """Make the cache's folders, see ``Backend``."""
        self.layout.create()

    def require_cache(self) -> None:
        """Refuse a folder of somebody else, see ``Backend``."""
        self.layout.require_cache()

    def exists(self) -> bool:
        """Return whether the folder is there."""
        return self.layout.root.is_dir()

    def record_keys(self) -> Iterator[str]:
        """Yield the key of each record, see ``Backend``."""
        return self.layout.record_keys()

    def last_used(self) -> Callable[[str], float]:
        """Return what reads the time of a record, see ``Backend``."""

        def of_record(key: str) -> float:
            try:
                return self.layout.record(key).stat().st_mtime
            except OSError:
                return 0.0

        return of_record

    def record(self, key: str) -> Entry:
        """Return the entry that a record tells, see ``Backend``."""
        return read_record(self.layout, key)

    def has(self, key: str) -> bool:
        """Return whether there is a record, see ``Backend``."""
        return self.layout.record(key).is_file()

    def compare(self, entry: Entry, policy: Policy) -> None:
        """Compare an entry's files as the policy says, see ``Backend``."""
        inspect_data(self.layout, entry, policy)

    def verify(self, key: str) -> Entry:
        """Return an entry after reading every byte of it again, see ``Backend``."""
        return inspect(self.layout, key, "full", remember=False).entry

    def set_aside(self, key: str, policy: Policy) -> None:
        """Move an entry to quarantine if it is damaged, see ``Backend``."""
        set_aside_if_damaged(self.layout, key, policy)

    def data(self, key: str, policy: Policy) -> tuple[Entry, Any]:
        """Return a checked entry and the zarr store of its files, see ``Backend``."""
        found = inspect(self.layout, key, policy)
        from semidense.cache.entries.reader import EntryStore

        return found.entry, EntryStore(self.layout.entry(key) / DATA, found.manifest)

    def begin(self, recipe: Recipe, label: Mapping[str, str], lease: Lease | None, maker: str) -> FolderDraft:
        """Return a draft in a folder of its own, see ``Backend``."""
        self.layout.create()
        name = (lease and lease.name) or hold(take_lease(self.layout))
        path = self.layout.draft(name, recipe.key, maker)
        draft = FolderDraft(recipe, label, time(), self.layout.root, path)
        with writing(path):
            add_folder(path)
        publish.STEP_HOOK("begun")
        return draft

    def publish_all(self, results: Sequence[Encoded], lease: Lease) -> list[Entry]:
        """Write results as drafts that nobody else writes to, and commit them together; see ``Backend``."""
        self.layout.create()
        own = None if lease.name else take_lease(self.layout)  # the run has none if it could not write when it began
        name = own.path.name if own else str(lease.name)
        drafts = {self.layout.new_draft(name): result for result in results}
        try:
            with writing(self.layout.drafts):
                entries = {draft: publish.write_result(draft, result) for draft, result in drafts.items()}
                return publish.commit(self.layout, entries)
        finally:
            for draft in drafts:
                publish.discard(draft)
            if own:
                own.release()

    def claim(self, key: str) -> Lock | None:
        """Return the lock of making a key, see ``Backend``."""
        path = self.layout.lock("making", key)
        self.layout.create()
        return try_lock(path)

    def claimant(self, key: str) -> str | None:
        """Return who holds that lock, see ``Backend``."""
        return holder(self.layout.lock("making", key))

    def lease(self) -> AbstractContextManager[Lease]:
        """Return a context with a lease, see ``Backend``."""
        return leased(self.layout)

    def checkpoint(self, key: str) -> StateFile:
        """Return the file of the states of long work, see ``Backend``."""
        return StateFile(self.layout.checkpoint(key))

    def keep_sources(self, code: Mapping[str, str]) -> None:
        """Keep the texts of modules, see ``Backend``."""
        keep_sources(self.layout, code)

    def kept_source(self, code_hash: str) -> str | None:
        """Return a text that was kept, see ``Backend``."""
        return kept_source(self.layout, code_hash)

    def sweep_drafts(self) -> int:
        """Delete drafts of dead runs, which it counts, locks, done checkpoints; see ``Backend``."""
        self.layout.require_cache()
        abandoned = [path for path in self.layout.things(self.layout.drafts) if is_abandoned(self.layout, path)]
        for path in abandoned:
            remove(path)
        with suppress(CacheUnavailable):
            sweep_locks(self.layout)
            sweep_checkpoints(self.layout)
        return len(abandoned)
