"""The cache as its users see it: find, require, open, begin."""

import re
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path
from time import time
from typing import TYPE_CHECKING, Any

from semidense.cache.document import plain_mapping
from semidense.cache.entries import publish
from semidense.cache.entries.check import Finding, Policy, inspect, inspect_data, read_record
from semidense.cache.entries.draft import Draft, hold
from semidense.cache.entries.entry import Entry
from semidense.cache.entries.quarantine import set_aside_if_damaged
from semidense.cache.errors import CacheUnavailable, DamagedEntry, EntryNotFound
from semidense.cache.files import make_folder, remove, writing
from semidense.cache.keys.recipe import Recipe, require_texts
from semidense.cache.keys.sources import keep_sources, kept_source
from semidense.cache.layout import Layout
from semidense.cache.processes.lease import Lease, is_abandoned, leased, sweep_checkpoints, sweep_locks, take_lease
from semidense.cache.processes.locks import Lock, holder, try_lock

if TYPE_CHECKING:
    import xarray
    import zarr
    from numpy.typing import NDArray


_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:/.*", re.ASCII)


@dataclass(frozen=True, init=False)
class Store:
    """A folder of published results, by key.

    Many processes and threads can use one folder at a time. A ``Store`` itself holds nothing but
    the path and the policy, and can be sent to other processes.

    Attributes:
        root: the folder, absolute; made on the first write.
        verify: how much of an entry is checked before it is used. ``full``: every byte, once a
            process for a file that does not change. ``size``: which files there are, and their
            sizes.

    Raises:
        CacheUnavailable: if ``root`` is a URL: a cache is a folder.
        ValueError: if ``verify`` is none of the three.
    """

    root: Path
    verify: Policy

    def __init__(self, root: Path, verify: Policy = "full") -> None:
        if verify not in ("full", "size"):
            raise ValueError(f"verify is {verify!r}: it must be full or size")
        if _URL.fullmatch(str(root)):
            raise CacheUnavailable(
                f"{root} is a URL, and a cache is a folder: name a folder of this machine or a share"
            )
        object.__setattr__(self, "root", Path(root).absolute())
        object.__setattr__(self, "verify", verify)

    @property
    def layout(self) -> Layout:
        """Where everything is."""
        return Layout(self.root)

    def find(self, key: str) -> Entry | None:
        """Return the entry of ``key`` as its record tells; None if there is none, or its record is damaged.

        Changes nothing and reads no data: ``check`` tells whether they are sound.

        Raises:
            InvalidKey: if ``key`` is not one.
            CacheUnavailable: if the file system refuses.
        """
        try:
            return read_record(self.layout, key)
        except (EntryNotFound, DamagedEntry):
            return None

    def check(self, key: str) -> str | None:
        """Return one line that says what is wrong with the entry of ``key``, None if it is sound; change nothing.

        Raises:
            InvalidKey: if ``key`` is not one.
            CacheUnavailable: if the file system refuses.
        """
        try:
            inspect(self.layout, key, self.verify)
        except (EntryNotFound, DamagedEntry) as error:
            return str(error)
        return None

    def has(self, key: str) -> bool:
        """Return whether there is a record of ``key``; reads nothing.

        Raises:
            InvalidKey: if ``key`` is not one.
        """
        return self.layout.record(key).is_file()

    def look(self, key: str) -> tuple[Entry | None, str | None]:
        """Return what ``find`` does, and of an entry that is there what ``check`` does; its record is read once.

        Raises:
            InvalidKey: if ``key`` is not one.
            CacheUnavailable: if the file system refuses.
        """
        if (entry := self.find(key)) is None:
            return None, None
        try:
            inspect_data(self.layout, entry, self.verify)
        except DamagedEntry as error:
            return entry, str(error)
        return entry, None

    def require(self, key: str) -> Entry:
        """Return the entry of ``key``, checked as the policy says; a damaged one is moved to quarantine.

        Raises:
            EntryNotFound: if there is none.
            DamagedEntry: if it is not what was published; it has to be made again.
            InvalidKey: if ``key`` is not one.
            CacheUnavailable: if the file system refuses.
        """
        return self._require(key).entry

    def open(self, key: str) -> "xarray.Dataset":
        """Return the entry's arrays, checked as ``require`` does, read from disk only when they are needed.

        Values are as stored: nothing is masked, scaled or decoded. ``attrs`` tells where they come
        from: key, digest, stage, code, params, inputs, environment, label, created, seconds, extras.
        A file that vanishes later raises ``DamagedEntry`` when it is read, never gives NaN.

        Raises:
            EntryNotFound, DamagedEntry, InvalidKey, CacheUnavailable: as ``require`` does.
        """
        found = self._require(key)
        from semidense.cache.entries.reader import open_dataset

        return open_dataset(self.layout.entry(key), found)

    def arrays(self, key: str) -> "dict[str, zarr.Array[Any]]":
        """Return the entry's arrays, checked as ``require`` does, without labels: for code that knows them.

        Raises:
            EntryNotFound, DamagedEntry, InvalidKey, CacheUnavailable: as ``require`` does.
        """
        found = self._require(key)
        from semidense.cache.entries.reader import open_group

        return dict(open_group(self.layout.entry(key), found).arrays())

    def read(self, key: str) -> "dict[str, NDArray[Any]]":
        """Return all arrays of the entry, in memory; checked as ``require`` does.

        Raises:
            EntryNotFound, DamagedEntry, InvalidKey, CacheUnavailable: as ``require`` does.
        """
        import numpy as np

        return {name: np.asarray(array[...]) for name, array in self.arrays(key).items()}

    def _require(self, key: str) -> Finding:
        """Look at an entry; move it aside if it is damaged."""
        try:
            return inspect(self.layout, key, self.verify)
        except DamagedEntry:
            set_aside_if_damaged(self.layout, key, self.verify)
            raise

    def begin(self, recipe: Recipe, label: Mapping[str, str], lease: Lease | None = None, maker: str = "") -> Draft:
        """Return a draft for the result of ``recipe``.

        Args:
            recipe: what it is made from.
            label: what people call it, such as product, dataset and scene; not part of the key.
            lease: of the run that makes it. Each process of the run is given the same draft, with all that was
                written by then. Without a lease the draft is a fresh one, which ends with this process.
            maker: tells apart those who make the same key in one run.

        Raises:
            InvalidRecipe: if the label does not map text to text.
            CacheUnavailable: if the folder cannot be written.
        """
        require_texts("label", label)
        self.layout.create()
        name = (lease and lease.name) or hold(take_lease(self.layout))
        path = self.layout.draft(name, recipe.key, maker)
        draft = Draft(self.root, path, recipe, plain_mapping("label", label), time())
        with writing(path):
            make_folder(path)
        publish.STEP_HOOK("begun")
        return draft

    def entries(self) -> Iterator[Entry]:
        """Yield every entry with a well-formed record, in the order of keys.

        Raises:
            CacheUnavailable: if the folder is not a cache, or the file system refuses.
        """
        self.layout.require_cache()
        return (entry for key in self.layout.record_keys() if (entry := self.find(key)))

    def history(self, label: Mapping[str, str]) -> list[Entry]:
        """Return the entries of exactly this label, newest first."""
        found = [entry for entry in self.entries() if entry.label == dict(label)]
        return sorted(found, key=lambda entry: (entry.created, entry.key), reverse=True)

    def claim(self, key: str) -> Lock | None:
        """Return the lock of making ``key``, None while another process or thread holds it; see ``claimant``.

        It saves work that two would do twice; it ends with its process, however that ends.

        Raises:
            InvalidKey: if ``key`` is not one.
            CacheUnavailable: if the folder cannot be written.
        """
        path = self.layout.lock("making", key)
        self.layout.create()
        return try_lock(path)

    def claimant(self, key: str) -> str | None:
        """Return who is making ``key``, such as ``process 123 on host``; None if nobody says so."""
        return holder(self.layout.lock("making", key))

    def lease(self) -> AbstractContextManager[Lease]:
        """Return a context whose ``add(keys)`` keeps entries, there or to come, from being cleaned away."""
        return leased(self.layout)

    def keep_sources(self, code: Mapping[str, str]) -> None:
        """Keep the texts of modules beside the entries, so that a change of code can be told by function and line.

        Args:
            code: hash by module name, as in a recipe.
        """
        keep_sources(self.layout, code)

    def kept_source(self, code_hash: str) -> str | None:
        """Return the text of a module that was kept under the hash of its code; None if there is none."""
        return kept_source(self.layout, code_hash)

    def sweep_drafts(self) -> int:
        """Delete what dead runs left: drafts, which it counts, locks, done checkpoints.

        Raises:
            CacheUnavailable: if the folder is not a cache, or the file system refuses.
        """
        self.layout.require_cache()
        abandoned = [path for path in self.layout.things(self.layout.drafts) if is_abandoned(self.layout, path)]
        for path in abandoned:
            remove(path)
        with suppress(CacheUnavailable):
            sweep_locks(self.layout)
            sweep_checkpoints(self.layout)
        return len(abandoned)
