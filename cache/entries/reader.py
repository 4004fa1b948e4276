"""Read an entry's arrays through its manifest alone. Imports zarr: loaded when data are opened."""

import json
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import zarr
from zarr.core.metadata import ArrayV3Metadata
from zarr.storage import LocalStore, StorePath

from semidense.cache.entries import forks  # noqa: F401 - importing it makes reads in forked children safe
from semidense.cache.entries.arrays import chunk_paths, decoded
from semidense.cache.entries.entry import DATA, Entry, File, Manifest
from semidense.cache.errors import DamagedEntry

if TYPE_CHECKING:
    import builtins
    from collections.abc import AsyncIterator, Iterable, Mapping

    import xarray as xr
    from numpy.typing import NDArray
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import Buffer, BufferPrototype

_AT_ONCE = 1 << 16
"""Bytes of a file that is read at once: handing it to one of zarr's threads takes longer."""


def files_by_name(manifest: Manifest) -> dict[str, File]:
    """Return the files of a manifest by the names that zarr has for them."""
    return {file.path.removeprefix(f"{DATA}/"): file for file in manifest.files}


class Listing:
    """What a zarr store of one manifest says of its files without reading them."""

    _sizes: "Mapping[str, int]"

    def arrays(self) -> "builtins.list[str]":
        """Return the names of the entry's arrays."""
        return [key.partition("/")[0] for key in self._sizes if key.endswith("/zarr.json")]

    async def getsize(self, key: str) -> int:
        """Return the size of a file of the manifest; FileNotFoundError if the manifest lists none."""
        if key not in self._sizes:
            raise FileNotFoundError(key)
        return self._sizes[key]

    async def exists(self, key: str) -> bool:
        """Return whether the manifest lists a file."""
        return key in self._sizes

    async def list(self) -> "AsyncIterator[str]":
        """Yield the files of the manifest."""
        for key in self._sizes:
            yield key

    async def list_prefix(self, prefix: str) -> "AsyncIterator[str]":
        """Yield the files of the manifest whose path begins so."""
        for key in self._sizes:
            if key.startswith(prefix):
                yield key

    async def list_dir(self, prefix: str) -> "AsyncIterator[str]":
        """Yield the names in a folder of the manifest."""
        start = f"{prefix.rstrip('/')}/" if prefix else ""
        for name in dict.fromkeys(key[len(start) :].partition("/")[0] for key in self._sizes if key.startswith(start)):
            yield name


class EntryStore(Listing, LocalStore):
    """A zarr store that holds the files of one manifest, no more and no less.

    To zarr a missing chunk is one full of fill values. Here it is an error: a file that the
    manifest lists and that vanished or changed its size since the entry was opened.
    """

    def __init__(self, root: Path, manifest: Manifest) -> None:
        super().__init__(root, read_only=True)
        self.manifest = manifest
        self._sizes = {name: file.size for name, file in files_by_name(manifest).items()}

    def with_read_only(self, read_only: bool = False) -> "EntryStore":
        """Return this store again; it is never anything but read-only."""
        if not read_only:
            raise DamagedEntry(f"{self.root} is published: nothing can be written to it")
        return type(self)(self.root, self.manifest)

    async def get(
        self, key: str, prototype: "BufferPrototype | None" = None, byte_range: "ByteRequest | None" = None
    ) -> "Buffer | None":
        """Return the bytes of a file of the manifest; None if the manifest lists none."""
        if key not in self._sizes:
            return None
        if self._sizes[key] <= _AT_ONCE:
            return self.get_sync(key, prototype=prototype, byte_range=byte_range)
        return self._require(key, await super().get(key, prototype, byte_range), byte_range)

    def get_sync(
        self,
        key: str,
        *,
        prototype: "BufferPrototype | None" = None,
        byte_range: "ByteRequest | None" = None,
    ) -> "Buffer | None":
        """Return the bytes of a file of the manifest; None if the manifest lists none."""
        if key not in self._sizes:
            return None
        return self._require(key, super().get_sync(key, prototype=prototype, byte_range=byte_range), byte_range)

    def read(self, key: str) -> bytes:
        """Return the bytes of a file of the manifest."""
        return self._require(key, super().get_sync(key), None).to_bytes()

    async def get_partial_values(
        self,
        prototype: "BufferPrototype",
        key_ranges: "Iterable[tuple[str, ByteRequest | None]]",
    ) -> "builtins.list[Buffer | None]":
        """Return parts of files of the manifest, each as ``get`` does."""
        return [await self.get(key, prototype, part) for key, part in key_ranges]

    def _require(self, key: str, data: "Buffer | None", byte_range: "ByteRequest | None") -> "Buffer":
        """Refuse a file that is no longer the one that the manifest lists."""
        if data is None or (byte_range is None and len(data) != self._sizes[key]):
            raise DamagedEntry(f"{self.root / key} changed or vanished while its entry was open: open it again")
        return data


def open_arrays(store: Any) -> "dict[str, zarr.Array[Any]]":  # noqa: ANN401 - what all backends' stores have in common
    """Return the arrays of an entry's store by name, as zarr opens them, but without a wait for its event loop."""
    about = {name: _described(store.read(f"{name}/zarr.json")) for name in store.arrays()}
    return {name: zarr.Array(zarr.AsyncArray(data, StorePath(store, name))) for name, data in about.items()}


@lru_cache(256)
def _described(data: bytes) -> ArrayV3Metadata:
    """Return what a metadata file says, parsed once for all arrays of a form: the scenes of a data set share theirs."""
    return ArrayV3Metadata.from_dict(json.loads(data))


def values_of(array: "zarr.Array[Any]") -> "NDArray[Any]":
    """Return all values of an array that ``open_arrays`` opened, the caller's own.

    One of a single chunk is decoded here: a wait for zarr's event loop takes longer than reading a small map.
    """
    if array.nchunks != 1:
        return np.asarray(array[...])
    (path,) = chunk_paths(array.shape, array.chunks)
    data = array.store.read(f"{array.path}/{path}")  # type: ignore[attr-defined]
    chunk = decoded(data, array.dtype).reshape(array.chunks)
    return chunk if chunk.shape == array.shape else chunk[tuple(slice(length) for length in array.shape)]


def open_dataset(store: Any, entry: Entry) -> "xr.Dataset":  # noqa: ANN401
    """Return the arrays of an entry's store as a lazy dataset, values as stored, its provenance in ``attrs``."""
    import xarray as xr

    dataset: xr.Dataset = xr.open_zarr(store, consolidated=False, chunks={}, decode_cf=False, zarr_format=3)
    return dataset.assign_attrs(entry.provenance())
