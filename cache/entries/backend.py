"""What the cache needs of the place where it is: a folder, or a prefix of an object store.

``FolderBackend`` (entries/folder.py) and ``ObjectBackend`` (objects/backend.py) are the two that there are. The seam is
here, at whole entries, and not at files: a folder has renames, locks that die with their process and hard links, an
object store has conditional writes, and each publishes safely in its own way.

Each backend promises:

- an entry exists from one atomic step on, and before that nobody sees a part of it;
- of two writers of a key one wins, and the other learns whether the two results are equal;
- no byte reaches a caller that is not the byte that was published;
- what a living lease names is not cleaned away.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, Protocol, Self

from semidense.cache.entries.encoded import Encoded
from semidense.cache.entries.entry import Entry
from semidense.cache.keys.recipe import Recipe

if TYPE_CHECKING:
    from numpy.typing import NDArray

Policy = Literal["full", "size"]
"""``full``: every byte. ``size``: which files there are, and their sizes."""


class Claim(Protocol):
    """The right to make a key, until it is released or its holder ends."""

    def release(self) -> None:
        """Let the next one have it."""


class Lease(Protocol):
    """The list of keys that a run uses; other processes that work for it can add to it."""

    @property
    def name(self) -> str | None:
        """The first part of the names of its run's drafts; None in a cache that cannot be written."""

    def discard_drafts(self) -> None:
        """Delete all drafts of its run, whichever process began them.

        Raises:
            CacheUnavailable: if the cache refuses.
        """

    def add(self, keys: Iterable[str]) -> None:
        """Keep the entries of these keys, those that are yet to come too, and note that they are in use.

        Raises:
            InvalidKey: if one is not a key.
            CacheUnavailable: if the cache refuses.
        """

    def is_seen(self) -> bool:
        """Return whether this process sees the lease: whether it works on the same cache as the run."""


class Checkpoint(Protocol):
    """The latest state of long work on a key."""

    def save(self, data: bytes) -> None:
        """Keep a state; a reader sees the old one or the new one, never a part."""

    def load(self) -> bytes | None:
        """Return the latest state; None if there is none."""

    def remove(self) -> None:
        """Delete the state, and what a killed writer left of one."""


@dataclass(frozen=True)
class Draft(ABC):
    """A result in the making, from ``Store.begin``; other processes and threads can write through a copy.

    As a context manager it publishes at the end of the block, unless the block did, and leaves
    nothing when the block fails. ``holds`` and ``published`` find what a writer did that was killed since.

    Attributes:
        recipe: what the result is made from.
        label: what people call it.
        started: when it was begun, in seconds since the epoch.
    """

    recipe: Recipe
    label: Mapping[str, str]
    started: float

    @abstractmethod
    def create_array(
        self,
        name: str,
        shape: Sequence[int],
        dtype: str,
        chunks: Sequence[int],
        dims: Sequence[str],
        attrs: Mapping[str, Any],
        fill_value: float | None = None,
    ) -> None:
        """Add an empty array; coordinates are 1-d arrays named like their dimension.

        Args:
            name: letters, digits and ``_``.
            shape: length of each dimension.
            dtype: NumPy name of a bool, integer or float type in native byte order.
            chunks: chunk length of each dimension; one longer than the array is cut to it.
            dims: a name for each dimension; arrays that share one must agree on its length.
            attrs: JSON only, such as ``units`` and ``long_name``.
            fill_value: recorded, never read: NaN for floats and zero for others if not given.

        Raises:
            InvalidArray: if an argument is not as said here, or the name is taken.
            InvalidRecipe: if ``attrs`` holds what JSON cannot.
            CacheUnavailable: if the cache refuses.
        """

    @abstractmethod
    def write(self, name: str, region: tuple[slice, ...], data: "NDArray[Any]") -> None:
        """Write one region of an array, whole chunks only: a chunk has one writer, and none is lost.

        A task may be tried twice and write a region again. In a folder the later bytes stay, in an object store the
        earlier ones: the bytes of one recipe are the same.

        Args:
            name: of an array made by ``create_array``.
            region: a slice a dimension, without steps; it starts at a chunk's start and ends at a
                chunk's or the array's end.
            data: of exactly the region's shape and the array's dtype.

        Raises:
            InvalidArray: if there is no such array, or region or data are not as said here.
            CacheUnavailable: if the cache refuses.
        """

    @abstractmethod
    def has_array(self, name: str) -> bool:
        """Return whether ``create_array`` made an array of this name."""

    @abstractmethod
    def holds(self, name: str, region: tuple[slice, ...] | None = None) -> bool:
        """Return whether a region of an array was written, by whichever process; None: all of the array.

        Args:
            name: of an array, made or not.
            region: as for ``write``.
        """

    @abstractmethod
    def published(self) -> Entry | None:
        """Return the entry that the draft became; None if it was deleted, or is still there.

        Where a publisher was killed between its last steps, they are done now.

        Raises:
            CacheUnavailable: if the cache refuses.
        """

    @abstractmethod
    def publish(self, seconds: float, extras: Mapping[str, Any]) -> Entry:
        """Make the draft an entry that everybody sees; the draft is gone afterwards, also when this fails.

        Args:
            seconds: what making it took.
            extras: JSON only: further provenance, such as versions and command line.

        Returns:
            The entry: the one that another writer published first, if there is one of this key.

        Raises:
            IncompleteDraft: if a chunk was never written.
            NonDeterministicStage: if another writer published other content under this key.
            InvalidRecipe: if ``extras`` holds what JSON cannot.
            CacheUnavailable: if the cache refuses.
        """

    @abstractmethod
    def discard(self) -> None:
        """Delete the draft; nothing happens if it was published or deleted before."""

    @abstractmethod
    def exists(self) -> bool:
        """Return whether the draft was neither published nor deleted."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None:
            self.discard()
        elif self.exists():
            self.publish(time.time() - self.started, {})


class Backend(Protocol):
    """The place of a cache. Every method raises ``CacheUnavailable`` if the place refuses."""

    @property
    def far(self) -> bool:
        """Whether an answer takes so long to come that several are asked for at a time."""

    def create(self) -> None:
        """Make the cache if it is not there; refuse a place that holds somebody else's files."""

    def require_cache(self) -> None:
        """Refuse a place that holds somebody else's files; an empty one is a cache."""

    def exists(self) -> bool:
        """Return whether something is there."""

    def record_keys(self) -> Iterator[str]:
        """Yield the key of each record, well-formed or not, in order."""

    def last_used(self) -> Callable[[str], float]:
        """Return what tells when an entry was made or last used, in seconds since the epoch; 0 if it is gone."""

    def record(self, key: str) -> Entry:
        """Return the entry that the record of ``key`` tells.

        Raises:
            EntryNotFound: if there is no record.
            DamagedEntry: if the record is not what was written.
        """

    def has(self, key: str) -> bool:
        """Return whether there is a record of ``key``; read nothing."""

    def compare(self, entry: Entry, policy: Policy) -> None:
        """Look at the data of an entry as their use asks for; change nothing.

        A folder's files are compared with the manifest here. An object's bytes are compared when they are read.

        Raises:
            DamagedEntry: if the data are not what was published.
        """

    def verify(self, key: str) -> Entry:
        """Return an entry after comparing every byte of it, read from the place itself, with its manifest.

        Raises:
            EntryNotFound, DamagedEntry: as ``record`` does; also if a byte differs.
        """

    def set_aside(self, key: str, policy: Policy) -> None:
        """Look again, and take a damaged entry out of sight: it is kept for people, and made again."""

    def data(self, key: str, policy: Policy) -> tuple[Entry, Any]:
        """Return a checked entry, and the zarr store that reads its arrays.

        Raises:
            EntryNotFound, DamagedEntry: as ``record`` does; the store also when it finds other bytes later.
        """

    def begin(self, recipe: Recipe, label: Mapping[str, str], lease: Lease | None, maker: str) -> Draft:
        """Return a draft, see ``Store.begin``."""

    def publish_all(self, results: Sequence[Encoded], lease: Lease) -> list[Entry]:
        """Publish results of one writer, see ``Store.publish_all``."""

    def claim(self, key: str) -> Claim | None:
        """Return the claim of making ``key``; None while another process or thread has it."""

    def claimant(self, key: str) -> str | None:
        """Return who is making ``key``, such as ``process 123 on host``; None if nobody says so."""

    def lease(self) -> AbstractContextManager[Lease]:
        """Return a context whose lease keeps entries from being cleaned away."""

    def checkpoint(self, key: str) -> Checkpoint:
        """Return the place of the states of long work on ``key``."""

    def keep_sources(self, code: Mapping[str, str]) -> None:
        """Keep the texts of modules by the hash of their code, as far as that is possible."""

    def kept_source(self, code_hash: str) -> str | None:
        """Return a text that was kept; None if there is none, or it is not the one."""

    def sweep_drafts(self) -> int:
        """Delete what dead runs left behind and is cheap to find; return how many drafts that were."""
