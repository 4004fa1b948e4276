"""Work in progress: a folder of its own into which arrays are written, and which is then published whole."""

import json
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from semidense.cache.document import canonical, parse
from semidense.cache.entries import publish
from semidense.cache.entries.arrays import chunk_paths, require_aligned, require_dtype
from semidense.cache.entries.entry import DATA, Entry
from semidense.cache.errors import IncompleteDraft, InvalidArray
from semidense.cache.files import writing
from semidense.cache.keys.recipe import Recipe
from semidense.cache.layout import Layout
from semidense.cache.processes.locks import Lock

if TYPE_CHECKING:
    import zarr
    from numpy.typing import NDArray

ZSTD_LEVEL = 1
"""Higher levels cost more time than they save space on float maps and float16 volumes."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)
_own: dict[str, Lock] = {}
"""Leases of drafts that belong to no run, by their name: held until the draft is published or deleted."""


def hold(lease: Lock) -> str:
    """Hold a lease for one draft alone, which is then to have its name; return the name."""
    _own[lease.path.name] = lease
    return lease.path.name


@dataclass(frozen=True)
class Draft:
    """A result in the making, from ``Store.begin``; other processes and threads can write through a copy.

    As a context manager it publishes at the end of the block, unless the block did, and leaves
    nothing when the block fails. ``holds`` and ``published`` find what a writer did that was killed since.

    Attributes:
        root: the cache's folder.
        path: the draft's own folder.
        recipe: what the result is made from.
        label: what people call it.
        started: when it was begun, in seconds since the epoch.
    """

    root: Path
    path: Path
    recipe: Recipe
    label: Mapping[str, str]
    started: float

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
            CacheUnavailable: if the file system refuses.
        """
        import numpy as np
        import zarr
        from zarr.codecs import ZstdCodec

        kind = require_dtype(name, dtype)
        with self._writing():
            self._require_fit(name, shape, chunks, dims)
            if not (self.path / DATA / "zarr.json").is_file():
                self._group()
            zarr.create_array(
                self.path / DATA / name,
                zarr_format=3,
                shape=tuple(shape),
                dtype=kind,
                chunks=tuple(max(1, min(chunk, size)) for chunk, size in zip(chunks, shape, strict=True)),
                filters=(),
                compressors=(ZstdCodec(level=ZSTD_LEVEL, checksum=True),),
                fill_value=fill_value if fill_value is not None else kind.type(np.nan if kind.kind == "f" else 0),
                dimension_names=tuple(dims),
                attributes=parse(canonical(attrs)),
                config={"write_empty_chunks": True},
            )
        publish.STEP_HOOK("array created")

    def _require_fit(
        self,
        name: str,
        shape: Sequence[int],
        chunks: Sequence[int],
        dims: Sequence[str],
    ) -> None:
        """Refuse an array that could not be opened together with the others."""
        where = f"array {name!r} of {self.recipe.stage}"
        others = self._sizes()
        if not _NAME.fullmatch(name) or name in others:
            raise InvalidArray(f"{where}: the name is taken, or not made of letters, digits and _")
        if not len(shape) == len(chunks) == len(dims) == len(set(dims)):
            raise InvalidArray(
                f"{where}: shape {shape}, chunks {chunks} and dims {dims} must have one item a dimension"
            )
        if any(size < 0 for size in shape) or any(chunk < 1 for chunk in chunks):
            raise InvalidArray(f"{where}: shape {shape} must not be negative, and chunks {chunks} must be positive")
        sizes = {dim: size for other in others.values() for dim, size in other.items()}
        for dim, size in zip(dims, shape, strict=True):
            if sizes.get(dim, size) != size:
                raise InvalidArray(f"{where}: {dim} has length {size}, in another array of the draft {sizes[dim]}")

    def write(self, name: str, region: tuple[slice, ...], data: "NDArray[Any]") -> None:
        """Write one region of an array, whole chunks only: a chunk has one writer, and none is lost.

        Writing a region again replaces it, so that a task may be tried twice.

        Args:
            name: of an array made by ``create_array``.
            region: a slice a dimension, without steps; it starts at a chunk's start and ends at a
                chunk's or the array's end.
            data: of exactly the region's shape and the array's dtype.

        Raises:
            InvalidArray: if there is no such array, or region or data are not as said here.
            CacheUnavailable: if the file system refuses.
        """
        with self._writing():
            array = self._array(name)
            where = f"array {name!r} of {self.recipe.stage}"
            bounds = require_aligned(where, array, region)
            expected = tuple(stop - start for start, stop in bounds)
            if data.shape != expected or data.dtype != array.dtype:
                raise InvalidArray(
                    f"{where}: the data are {data.dtype} {data.shape}, the region takes {array.dtype} {expected}"
                )
            array[tuple(slice(*pair) for pair in bounds)] = data
        publish.STEP_HOOK("chunk written")

    def has_array(self, name: str) -> bool:
        """Return whether ``create_array`` made an array of this name."""
        return bool(_NAME.fullmatch(name)) and self._about(name).is_file()

    def holds(self, name: str, region: tuple[slice, ...] | None = None) -> bool:
        """Return whether a region of an array was written, by whichever process; None: all of the array.

        Args:
            name: of an array, made or not.
            region: as for ``write``.
        """
        if not self.has_array(name):
            return False
        about = json.loads(self._about(name).read_bytes())
        shape, chunks = about["shape"], about["chunk_grid"]["configuration"]["chunk_shape"]
        return all((self.path / DATA / name / chunk).is_file() for chunk in chunk_paths(shape, chunks, region))

    def published(self) -> Entry | None:
        """Return the entry that the draft became; None if it was deleted, or is still there.

        Where a publisher was killed between its last steps, they are done now.

        Raises:
            CacheUnavailable: if the file system refuses.
        """
        return publish.resume(Layout(self.root), self.path, self.recipe.key)

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
            CacheUnavailable: if the file system refuses.
        """
        try:
            with self._writing():
                paths = self._complete()
                publish.remove_strays(self.path, paths)
                publish.STEP_HOOK("complete")
                manifest = publish.seal(self.path, paths)
                now = datetime.now(UTC).isoformat(timespec="microseconds")
                label, key = self.label, self.recipe.key
                entry = Entry(key, self.recipe, manifest.digest, label, now, float(seconds), manifest.size, extras)
                return publish.commit(Layout(self.root), self.path, entry)
        finally:
            self.discard()

    def discard(self) -> None:
        """Delete the draft; nothing happens if it was published or deleted before."""
        publish.discard(self.path)
        if own := _own.pop(self.path.name.partition("-")[0], None):
            own.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None:
            self.discard()
        elif self.path.exists():
            self.publish(time.time() - self.started, {})

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Refuse to bring a draft back that was published or deleted, and explain what the file system refuses."""
        if not self.path.is_dir():
            raise InvalidArray(f"the draft of {self.recipe.stage} is gone: {self.path} was published or deleted")
        with writing(self.path):
            yield

    def _about(self, name: str) -> Path:
        return self.path / DATA / name / "zarr.json"

    def _metadata(self) -> dict[str, dict[str, Any]]:
        """Return what zarr wrote of each array that is there.

        Read from the files: zarr would open every array, and a product of small ones would wait for that most.
        """
        return {path.parent.name: json.loads(path.read_bytes()) for path in (self.path / DATA).glob("*/zarr.json")}

    def _sizes(self) -> dict[str, dict[str, int]]:
        """Return the length of each dimension of each array that is there."""
        return {
            name: dict(zip(each.get("dimension_names", ()), each["shape"], strict=True))
            for name, each in self._metadata().items()
        }

    def _group(self) -> "zarr.Group":
        """Open the draft's arrays; the group is there from the first of them on."""
        import zarr

        return zarr.open_group(self.path / DATA, mode="a", zarr_format=3)

    def _array(self, name: str) -> "zarr.Array[Any]":
        """Open one array so that every chunk written becomes a file, also one that is all fill value."""
        import zarr

        if not _NAME.fullmatch(name) or not (self.path / DATA / name).is_dir():
            raise InvalidArray(f"{self.recipe.stage} has no array {name!r}: create it before writing")
        array = zarr.open_array(self.path / DATA / name, mode="r+", zarr_format=3)
        return array.with_config({"write_empty_chunks": True})  # open_array itself ignores this setting (zarr 3.1)

    def _complete(self) -> list[str]:
        """Return the path of every file of the draft, once each is known to be there."""
        arrays = self._metadata()
        if not arrays:
            raise IncompleteDraft(f"the draft of {self.recipe.stage} has no array: create and write one")
        paths = [f"{DATA}/zarr.json"]
        for name, about in arrays.items():
            chunks = chunk_paths(about["shape"], about["chunk_grid"]["configuration"]["chunk_shape"])
            paths += [f"{DATA}/{name}/{path}" for path in ("zarr.json", *chunks)]
        missing = [path for path in paths if not (self.path / path).is_file()]
        if missing:
            raise IncompleteDraft(
                f"the draft of {self.recipe.stage} lacks {len(missing)} of {len(paths)} files, first {missing[0]}: "
                "write every region before publishing"
            )
        return paths
