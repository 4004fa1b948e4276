"""Work in progress in a folder: one of its own into which arrays are written, and which is then published whole."""

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semidense.cache.entries import publish
from semidense.cache.entries.arrays import (
    NAME,
    array_metadata,
    chunk_paths,
    chunks_of,
    encoded,
    group_metadata,
    require_dtype,
    require_fit,
)
from semidense.cache.entries.backend import Draft
from semidense.cache.entries.entry import DATA, Entry
from semidense.cache.errors import IncompleteDraft, InvalidArray
from semidense.cache.files import shared_out, write_whole, writing
from semidense.cache.layout import Layout
from semidense.cache.processes.locks import Lock

if TYPE_CHECKING:
    from numpy.typing import NDArray

_own: dict[str, Lock] = {}
"""Leases of drafts that belong to no run, by their name: held until the draft is published or deleted."""


def hold(lease: Lock) -> str:
    """Hold a lease for one draft alone, which is then to have its name; return the name."""
    _own[lease.path.name] = lease
    return lease.path.name


def _content(path: str) -> bytes:
    with open(path, "rb", buffering=0) as file:
        return file.read()


@dataclass(frozen=True)
class FolderDraft(Draft):
    """A draft in a folder of its own; ``Draft`` says what its methods do.

    Attributes:
        root: the cache's folder.
        path: the draft's own folder.
    """

    root: Path
    path: Path

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
        """Add an empty array, see ``Draft``."""
        kind = require_dtype(name, dtype)
        with self._writing():
            require_fit(self.recipe.stage, self._sizes(), name, shape, chunks, dims)
            if not os.path.isfile(group := f"{self.path}/{DATA}/zarr.json"):
                write_whole(group, group_metadata())
            write_whole(self._about(name), array_metadata(shape, kind, chunks, dims, attrs, fill_value))
        publish.STEP_HOOK("array created")

    def write(self, name: str, region: tuple[slice, ...], data: "NDArray[Any]") -> None:
        """Write one region of an array, see ``Draft``."""
        with self._writing():
            chunks = chunks_of(f"array {name!r} of {self.recipe.stage}", self._metadata_of(name), region, data)
            folder = f"{self.path}/{DATA}/{name}"
            shared_out(lambda chunk: write_whole(f"{folder}/{chunk[0]}", encoded(chunk[1])), chunks, data.nbytes)
        publish.STEP_HOOK("chunk written")

    def has_array(self, name: str) -> bool:
        """Return whether ``create_array`` made an array of this name."""
        return bool(NAME.fullmatch(name)) and os.path.isfile(self._about(name))

    def holds(self, name: str, region: tuple[slice, ...] | None = None) -> bool:
        """Return whether a region of an array was written, see ``Draft``."""
        if not self.has_array(name):
            return False
        about = json.loads(_content(self._about(name)))
        shape, chunks = about["shape"], about["chunk_grid"]["configuration"]["chunk_shape"]
        folder = f"{self.path}/{DATA}/{name}"
        return all(os.path.isfile(f"{folder}/{chunk}") for chunk in chunk_paths(shape, chunks, region))

    def published(self) -> Entry | None:
        """Return the entry that the draft became, see ``Draft``."""
        return publish.resume(Layout(self.root), self.path, self.recipe.key)

    def publish(self, seconds: float, extras: Mapping[str, Any]) -> Entry:
        """Make the draft an entry that everybody sees, see ``Draft``."""
        try:
            with self._writing():
                paths = self._complete()
                publish.remove_strays(self.path, paths)
                publish.STEP_HOOK("complete")
                manifest = publish.seal(self.path, paths)
                entry = Entry.now(self.recipe, self.label, manifest, seconds, extras)
                return publish.commit(Layout(self.root), {self.path: entry})[0]
        finally:
            self.discard()

    def discard(self) -> None:
        """Delete the draft; nothing happens if it was published or deleted before."""
        publish.discard(self.path)
        if own := _own.pop(self.path.name.partition("-")[0], None):
            own.release()

    def exists(self) -> bool:
        """Return whether the draft was neither published nor deleted."""
        return self.path.exists()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Refuse to bring a draft back that was published or deleted, and explain what the file system refuses."""
        if not self.path.is_dir():
            raise InvalidArray(f"the draft of {self.recipe.stage} is gone: {self.path} was published or deleted")
        with writing(self.path):
            yield

    def _about(self, name: str) -> str:
        return f"{self.path}/{DATA}/{name}/zarr.json"

    def _metadata(self) -> dict[str, dict[str, Any]]:
        """Return what zarr wrote of each array that is there.

        Read from the files: zarr would open every array, and a product of small ones would wait for that most.
        """
        names = os.listdir(data) if os.path.isdir(data := f"{self.path}/{DATA}") else []
        files = {name: self._about(name) for name in names}
        return {name: json.loads(_content(file)) for name, file in files.items() if os.path.isfile(file)}

    def _sizes(self) -> dict[str, dict[str, int]]:
        """Return the length of each dimension of each array that is there."""
        return {
            name: dict(zip(each.get("dimension_names", ()), each["shape"], strict=True))
            for name, each in self._metadata().items()
        }

    def _metadata_of(self, name: str) -> bytes:
        """Return the metadata file of one array; InvalidArray if it was not created."""
        if not self.has_array(name):
            raise InvalidArray(f"{self.recipe.stage} has no array {name!r}: create it before writing")
        return _content(self._about(name))

    def _complete(self) -> list[str]:
        """Return the path of every file of the draft, once each is known to be there."""
        arrays = self._metadata()
        if not arrays:
            raise IncompleteDraft(f"the draft of {self.recipe.stage} has no array: create and write one")
        paths = [f"{DATA}/zarr.json"]
        for name, about in arrays.items():
            chunks = chunk_paths(about["shape"], about["chunk_grid"]["configuration"]["chunk_shape"])
            paths += [f"{DATA}/{name}/{path}" for path in ("zarr.json", *chunks)]
        missing = [path for path in paths if not os.path.isfile(f"{self.path}/{path}")]
        if missing:
            raise IncompleteDraft(
                f"the draft of {self.recipe.stage} lacks {len(missing)} of {len(paths)} files, first {missing[0]}: "
                "write every region before publishing"
            )
        return paths
