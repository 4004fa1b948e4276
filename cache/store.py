"""The cache as its users see it: find, require, open, begin."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from semidense.cache.document import plain_mapping
from semidense.cache.entries.backend import Backend, Checkpoint, Claim, Draft, Lease, Policy
from semidense.cache.entries.encoded import Encoded
from semidense.cache.entries.entry import Entry
from semidense.cache.entries.folder import FolderBackend
from semidense.cache.errors import CacheUnavailable, DamagedEntry, EntryNotFound
from semidense.cache.files import in_threads
from semidense.cache.keys.recipe import Recipe, require_texts
from semidense.cache.layout import Layout, place_of

T = TypeVar("T")
if TYPE_CHECKING:
    import xarray
    import zarr
    from numpy.typing import NDArray


@dataclass(frozen=True, init=False)
class Store:
    """A folder, or a prefix of an object store, of published results by key.

    Many processes and threads can use one at a time. A ``Store`` itself holds nothing but
    the place and the policy, and can be sent to other processes.

    Attributes:
        root: the folder, absolute, or the URL; made on the first write.
        verify: how much of an entry in a folder is checked before it is used. ``full``: every byte, once a
            process for a file that does not change. ``size``: which files there are, and their
            sizes. Of an entry in an object store every byte is checked when it is read.

    Raises:
        CacheUnavailable: if ``root`` is a URL of another kind than ``SCHEMES``.
        ValueError: if ``verify`` is none of the two.
    """

    root: Path | str
    verify: Policy

    def __init__(self, root: Path | str, verify: Policy = "full") -> None:
        if verify not in ("full", "size"):
            raise ValueError(f"verify is {verify!r}: it must be full or size")
        object.__setattr__(self, "root", place_of(root))
        object.__setattr__(self, "verify", verify)

    @property
    def backend(self) -> Backend:
        """What the cache needs of its place."""
        if isinstance(self.root, Path):
            return FolderBackend(Layout(self.root))
        from semidense.cache.objects.backend import ObjectBackend

        return ObjectBackend(self.root)

    @property
    def layout(self) -> Layout:
        """Where everything is in the folder.

        Raises:
            CacheUnavailable: if the cache is in an object store.
        """
        if isinstance(self.root, Path):
            return Layout(self.root)
        raise CacheUnavailable(f"{self.root} is an object store, and this needs a cache in a folder")

    def exists(self) -> bool:
        """Return whether a cache is there.

        Raises:
            CacheUnavailable: if the place refuses.
        """
        return self.backend.exists()

    def find(self, key: str) -> Entry | None:
        """Return the entry of ``key`` as its record tells; None if there is none, or its record is damaged.

        Changes nothing and reads no data: ``check`` tells whether they are sound.

        Raises:
            InvalidKey: if ``key`` is not one.
            CacheUnavailable: if the file system refuses.
        """
        try:
            return self.backend.record(key)
        except (EntryNotFound, DamagedEntry):
            return None

    def check(self, key: str) -> str | None:
        """Return one line that says what is wrong with the entry of ``key``, None if it is sound; change nothing.

        Raises:
            InvalidKey: if ``key`` is not one.
            CacheUnavailable: if the file system refuses.
        """
        try:
            self._checked(key)
        except (EntryNotFound, DamagedEntry) as error:
            return str(error)
        return None

    def has_all(self, keys: Iterable[str]) -> bool:
        """Return whether there is a record of each of these keys; reads nothing, and asks for several at a time.

        Raises:
            InvalidKey: if one is not a key.
        """
        return all(in_threads(self.backend.has, keys))

    def look(self, key: str) -> tuple[Entry | None, str | None]:
        """Return what ``find`` does, and of an entry that is there what ``check`` does; its record is read once.

        Raises:
            InvalidKey: if ``key`` is not one.
            CacheUnavailable: if the file system refuses.
        """
        if (entry := self.find(key)) is None:
            return None, None
        try:
            self.backend.compare(entry, self.verify)
        except DamagedEntry as error:
            return entry, str(error)
        return entry, None

    def look_all(self, keys: Iterable[str]) -> list[tuple[Entry | None, str | None]]:
        """Return what ``look`` does for each of these keys, in order; in a far place several are looked at at a time.

        On a disk threads would take twice the time for small entries: each waits for the interpreter's lock after each
        file. The files of a large entry are compared in threads all the same.
        """
        return in_threads(self.look, keys) if self.backend.far else [self.look(key) for key in keys]

    def require(self, key: str) -> Entry:
        """Return the entry of ``key``, checked as the policy says; a damaged one is moved to quarantine.

        Raises:
            EntryNotFound: if there is none.
            DamagedEntry: if it is not what was published; it has to be made again.
            InvalidKey: if ``key`` is not one.
            CacheUnavailable: if the file system refuses.
        """
        return self._aside(key, lambda: self._checked(key))

    def open(self, key: str) -> "xarray.Dataset":
        """Return the entry's arrays, checked as ``require`` does, read from disk only when they are needed.

        Values are as stored: nothing is masked, scaled or decoded. ``attrs`` tells where they come
        from: key, digest, stage, code, params, inputs, environment, label, created, seconds, extras.
        A file that vanishes later raises ``DamagedEntry`` when it is read, never gives NaN.

        Raises:
            EntryNotFound, DamagedEntry, InvalidKey, CacheUnavailable: as ``require`` does.
        """
        entry, data = self._aside(key, lambda: self.backend.data(key, self.verify))
        from semidense.cache.entries.reader import open_dataset

        return open_dataset(data, entry)

    def arrays(self, key: str) -> "dict[str, zarr.Array[Any]]":
        """Return the entry's arrays, checked as ``require`` does, without labels: for code that knows them.

        Raises:
            EntryNotFound, DamagedEntry, InvalidKey, CacheUnavailable: as ``require`` does.
        """
        _, data = self._aside(key, lambda: self.backend.data(key, self.verify))
        from semidense.cache.entries.reader import open_arrays

        return open_arrays(data)

    def read(self, key: str) -> "dict[str, NDArray[Any]]":
        """Return all arrays of the entry, in memory; checked as ``require`` does.

        Raises:
            EntryNotFound, DamagedEntry, InvalidKey, CacheUnavailable: as ``require`` does.
        """
        from semidense.cache.entries.reader import values_of

        return {name: values_of(array) for name, array in self.arrays(key).items()}

    def _checked(self, key: str) -> Entry:
        entry = self.backend.record(key)
        self.backend.compare(entry, self.verify)
        return entry

    def _aside(self, key: str, look: Callable[[], T]) -> T:
        """Look at an entry; move it aside if it is damaged."""
        try:
            return look()
        except DamagedEntry:
            self.backend.set_aside(key, self.verify)
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
        return self.backend.begin(recipe, plain_mapping("label", label), lease, maker)

    def publish_all(self, results: Sequence[Encoded], lease: Lease) -> list[Entry]:
        """Publish small results of one writer together, and return their entries in order.

        Each exists from a step of its own on, as if it came from a draft. But all are written and synced at one time:
        for a disk, and for a far place, that takes little longer than one of them. Killed before the end, this leaves
        some of them, each whole.

        Args:
            results: of different keys, from ``encode``.
            lease: of the run that made them; it has their keys.

        Raises:
            NonDeterministicStage: if another writer published other content under one of the keys.
            CacheUnavailable: if the cache refuses.
        """
        return self.backend.publish_all(results, lease)

    def entries(self) -> Iterator[Entry]:
        """Yield every entry with a well-formed record, in the order of keys.

        Raises:
            CacheUnavailable: if the folder is not a cache, or the file system refuses.
        """
        self.backend.require_cache()
        return (entry for entry in in_threads(self.find, self.backend.record_keys()) if entry)

    def history(self, label: Mapping[str, str]) -> list[Entry]:
        """Return the entries of exactly this label, newest first."""
        found = [entry for entry in self.entries() if entry.label == dict(label)]
        return sorted(found, key=lambda entry: (entry.created, entry.key), reverse=True)

    def last_used(self) -> Callable[[str], float]:
        """Return what tells when an entry was made or last used, in seconds since the epoch; 0 if it is gone."""
        return self.backend.last_used()

    def claim(self, key: str) -> Claim | None:
        """Return the claim of making ``key``, None while another process or thread has it; see ``claimant``.

        It saves work that two would do twice; it ends with its process, however that ends.

        Raises:
            InvalidKey: if ``key`` is not one.
            CacheUnavailable: if the cache cannot be written.
        """
        return self.backend.claim(key)

    def claimant(self, key: str) -> str | None:
        """Return who is making ``key``, such as ``process 123 on host``; None if nobody says so."""
        return self.backend.claimant(key)

    def lease(self) -> AbstractContextManager[Lease]:
        """Return a context whose ``add(keys)`` keeps entries, there or to come, from being cleaned away."""
        return self.backend.lease()

    def checkpoint(self, key: str) -> Checkpoint:
        """Return the place of the states of long work on ``key``."""
        return self.backend.checkpoint(key)

    def keep_sources(self, code: Mapping[str, str]) -> None:
        """Keep the texts of modules beside the entries, so that a change of code can be told by function and line.

        Args:
            code: hash by module name, as in a recipe.
        """
        self.backend.keep_sources(code)

    def kept_source(self, code_hash: str) -> str | None:
        """Return the text of a module that was kept under the hash of its code; None if there is none."""
        return self.backend.kept_source(code_hash)

    def sweep_drafts(self) -> int:
        """Delete what dead runs left: drafts, which it counts, locks, done checkpoints.

        In an object store this is left to a cleaning, which lists everything anyway.

        Raises:
            CacheUnavailable: if the place holds somebody else's files, or refuses.
        """
        return self.backend.sweep_drafts()
