"""Read an entry's arrays from an object store, chunk by chunk; every byte is compared with the manifest."""

import asyncio
import hashlib
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from zarr.abc.store import ByteRequest, OffsetByteRequest, RangeByteRequest, Store, SuffixByteRequest

from semidense.cache.entries import forks  # noqa: F401 - importing it makes reads in forked children safe
from semidense.cache.entries.entry import File, Manifest
from semidense.cache.entries.reader import Listing, files_by_name
from semidense.cache.errors import DamagedEntry
from semidense.cache.objects.near import near
from semidense.cache.objects.records import Record
from semidense.cache.objects.requests import Objects

if TYPE_CHECKING:
    import builtins

    from zarr.core.buffer import Buffer, BufferPrototype

Fetch = Callable[[File], bytes]
"""Returns the bytes of a file of an entry, or raises ``DamagedEntry``."""


def fetch(objects: Objects, record: Record, file: File, kept: bool = True) -> bytes:
    """Return the bytes of a file of an entry, each compared with the manifest.

    Args:
        objects: of the cache.
        record: of the entry.
        file: of its manifest.
        kept: whether what this machine keeps may be returned; else the store is read.

    Raises:
        DamagedEntry: if the object is missing, or is not what was published.
        CacheUnavailable: if the store refuses.
    """
    if kept and (data := near().get(file.sha256)) is not None:
        return data
    found = objects.get(f"data/{record.place}/{file.path}")
    if found is None:
        raise DamagedEntry(f"the entry {record.entry.key} is damaged: {file.path} is missing")
    if hashlib.sha256(found.data).hexdigest() != file.sha256:
        raise DamagedEntry(f"the entry {record.entry.key} is damaged: the bytes of {file.path} are not those written")
    near().keep(file.sha256, found.data)
    return found.data


class ObjectStore(Listing, Store):
    """A zarr store that holds the files of one manifest, no more and no less, and fetches them when they are read."""

    def __init__(self, manifest: Manifest, fetch: Fetch) -> None:
        super().__init__(read_only=True)
        self._manifest, self._fetch = manifest, fetch
        self._files = files_by_name(manifest)
        self._sizes = {name: file.size for name, file in self._files.items()}

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ObjectStore) and self._manifest == other._manifest

    __hash__ = None  # type: ignore[assignment]

    supports_writes = False
    supports_deletes = False
    supports_listing = True

    def with_read_only(self, read_only: bool = False) -> "ObjectStore":
        """Return this store again; it is never anything but read-only."""
        self._check_readable(read_only)
        return self

    def read(self, key: str) -> bytes:
        """Return the bytes of a file of the manifest."""
        return self._fetch(self._files[key])

    async def get(
        self, key: str, prototype: "BufferPrototype | None" = None, byte_range: ByteRequest | None = None
    ) -> "Buffer | None":
        """Return the bytes of a file of the manifest; None if the manifest lists none."""
        from zarr.core.buffer import default_buffer_prototype

        if key not in self._files:
            return None
        data = await asyncio.to_thread(self._fetch, self._files[key])
        return (prototype or default_buffer_prototype()).buffer.from_bytes(data[_part(len(data), byte_range)])

    async def get_partial_values(
        self, prototype: "BufferPrototype", key_ranges: "Iterable[tuple[str, ByteRequest | None]]"
    ) -> "builtins.list[Buffer | None]":
        """Return parts of files of the manifest, each as ``get`` does."""
        return [await self.get(key, prototype, part) for key, part in key_ranges]

    async def set(self, key: str, value: "Buffer") -> None:
        """Refuse to write."""
        self._check_readable(False)

    async def delete(self, key: str) -> None:
        """Refuse to delete."""
        self._check_readable(False)

    def _check_readable(self, read_only: bool) -> None:
        if not read_only:
            raise DamagedEntry("the entry is published: nothing can be written to it")


def _part(size: int, part: ByteRequest | None) -> slice:
    """Return the slice of a file's bytes that is asked for."""
    if isinstance(part, RangeByteRequest):
        return slice(part.start, part.end)
    if isinstance(part, OffsetByteRequest):
        return slice(part.offset, None)
    return slice(max(0, size - part.suffix), None) if isinstance(part, SuffixByteRequest) else slice(None)
