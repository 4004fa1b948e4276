"""Work in progress in an object store: chunks are created where they stay, and nobody sees them without a record."""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import count
from typing import TYPE_CHECKING, Any

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
from semidense.cache.entries.entry import DATA, MANIFEST, Entry, File, Manifest
from semidense.cache.errors import DamagedEntry, EntryNotFound, IncompleteDraft, InvalidArray, InvalidKey
from semidense.cache.files import in_threads
from semidense.cache.objects import names, records
from semidense.cache.objects.living import Living
from semidense.cache.objects.near import near
from semidense.cache.objects.requests import Found, Objects, connect

if TYPE_CHECKING:
    from numpy.typing import NDArray

GIVEN_UP = b"given up\n"
"""Stands in place of the manifest of a draft that will never be published."""
_HASH = "sha256"
_own: dict[str, Living] = {}
"""Leases of drafts that belong to no run, by their place: held until the draft is published or deleted."""


def place_for(objects: Objects, lease: str, key: str, maker: str) -> str:
    """Return where a maker makes ``key``: the first of its places that no earlier attempt of the run gave up."""
    places = (names.place(lease, key, maker, attempt) for attempt in count())
    return next(each for each in places if not _is_given_up(objects.get(f"data/{each}/{MANIFEST}")))


def _is_given_up(manifest: Found | None) -> bool:
    return manifest is not None and manifest.data == GIVEN_UP


def hold(place: str, lease: Living) -> None:
    """Hold a lease for one draft alone."""
    _own[place] = lease


@dataclass(frozen=True)
class ObjectDraft(Draft):
    """A draft below a prefix of its own; ``Draft`` says what its methods do.

    Attributes:
        url: of the cache.
        place: of the data, now and when they are published.
    """

    url: str
    place: str

    @property
    def _objects(self) -> Objects:
        return connect(self.url)

    @property
    def _mark(self) -> str:
        return f"drafts/{self.place}"

    def _path(self, path: str) -> str:
        return f"data/{self.place}/{path}"

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
        require_fit(self.recipe.stage, self._sizes(), name, shape, chunks, dims)
        metadata = array_metadata(shape, kind, chunks, dims, attrs, fill_value)
        self._announce(name)
        self._put(f"{DATA}/zarr.json", group_metadata())
        self._put(f"{DATA}/{name}/zarr.json", metadata)

    def write(self, name: str, region: tuple[slice, ...], data: "NDArray[Any]") -> None:
        """Write one region of an array, see ``Draft``."""
        self._require_exists()
        chunks = chunks_of(f"array {name!r} of {self.recipe.stage}", self._metadata_of(name), region, data)
        in_threads(lambda chunk: self._put(f"{DATA}/{name}/{chunk[0]}", encoded(chunk[1])), chunks)

    def fill(self, files: Mapping[str, bytes]) -> None:
        """Write all files of a result at one go."""
        self._announce(*sorted({path.split("/")[1] for path in files} - {"zarr.json"}))
        in_threads(lambda file: self._put(*file), files.items())

    def has_array(self, name: str) -> bool:
        """Return whether ``create_array`` made an array of this name."""
        return bool(NAME.fullmatch(name)) and self._about(name) is not None

    def holds(self, name: str, region: tuple[slice, ...] | None = None) -> bool:
        """Return whether a region of an array was written, see ``Draft``."""
        if not self.has_array(name):
            return False
        return all(self._objects.head(self._path(path)) for path in self._chunks(name, region))

    def published(self) -> Entry | None:
        """Return the entry that the draft became, see ``Draft``."""
        try:
            record = records.read(self._objects, self.recipe.key)
        except (EntryNotFound, DamagedEntry):
            return None
        if record.place == self.place:
            discard(self._objects, self.place)
        return None if self.exists() else record.entry

    def publish(self, seconds: float, extras: Mapping[str, Any]) -> Entry:
        """Make the draft an entry that everybody sees, see ``Draft``."""
        try:
            self._require_exists()
            manifest = self._manifest()
            entry = Entry.now(self.recipe, self.label, manifest, seconds, extras)
            self._decide(manifest.to_bytes())
            record = records.publish(self._objects, records.Record(entry, self.place))
        except BaseException:
            self.discard()
            raise
        self._end(record)
        return record.entry

    def _end(self, record: records.Record) -> None:
        """Forget the draft that became a record; delete one that came second."""
        if record.place == self.place:
            self._objects.delete([self._mark])
            self._release()
        else:
            self.discard()

    def _decide(self, manifest: bytes) -> None:
        """Create the manifest, unless the draft was given up before."""
        there = self._objects.create(self._path(MANIFEST), manifest)
        if there:
            raise IncompleteDraft(f"the draft of {self.recipe.stage} is gone: it was given up in {self.url}")

    def discard(self) -> None:
        """Delete the draft, see ``Draft``."""
        discard(self._objects, self.place)
        self._release()

    def _release(self) -> None:
        if own := _own.pop(self.place, None):
            own.release()

    def exists(self) -> bool:
        """Return whether the draft was neither published nor deleted."""
        return self._objects.head(self._mark) is not None

    def begin(self) -> None:
        """Note that the draft exists."""
        self._objects.create(self._mark, self.recipe.key.encode("ascii"))

    def _require_exists(self) -> None:
        if not self.exists():
            raise self._gone()

    def _gone(self) -> InvalidArray:
        return InvalidArray(
            f"the draft of {self.recipe.stage} is gone: {self.place} in {self.url} was published or deleted"
        )

    def _announce(self, *names: str) -> None:
        """Add arrays to those that the mark names: whoever publishes must know them all, and a list may come late."""
        while mark := self._objects.get(self._mark):
            new = "".join(f"\n{name}" for name in names if name not in _arrays_of(mark))
            if not new or self._objects.replace(self._mark, mark.data + new.encode(), mark):
                return
        raise self._gone()

    def _put(self, path: str, data: bytes) -> None:
        """Create a file of the draft with its hash beside it; what another writer created first stays."""
        sha256 = hashlib.sha256(data).hexdigest()
        if self._objects.create(self._path(path), data, {_HASH: sha256}) is None:
            near().keep(sha256, data)

    def _about(self, name: str) -> dict[str, Any] | None:
        """Return what zarr wrote of an array; None if it was not created."""
        return _metadata(self.url, self._path(f"{DATA}/{name}/zarr.json"))

    def _arrays(self) -> list[str]:
        """Return the names of all arrays; of one whose creator was killed, nothing may be there yet."""
        if (mark := self._objects.get(self._mark)) is None:
            raise self._gone()
        return _arrays_of(mark)

    def _sizes(self) -> dict[str, dict[str, int]]:
        """Return the length of each dimension of each array that is there."""
        found = {name: self._about(name) for name in self._arrays()}
        return {
            name: dict(zip(each.get("dimension_names", ()), each["shape"], strict=True))
            for name, each in found.items()
            if each is not None
        }

    def _chunks(self, name: str, region: tuple[slice, ...] | None = None) -> list[str]:
        if (about := self._about(name)) is None:
            return []
        chunks = chunk_paths(about["shape"], about["chunk_grid"]["configuration"]["chunk_shape"], region)
        return [f"{DATA}/{name}/{path}" for path in chunks]

    def _metadata_of(self, name: str) -> bytes:
        """Return the metadata file of one array; InvalidArray if it was not created."""
        if not self.has_array(name):
            raise InvalidArray(f"{self.recipe.stage} has no array {name!r}: create it before writing")
        return _known(self.url, self._path(f"{DATA}/{name}/zarr.json")).encode("utf-8")

    def _manifest(self) -> Manifest:
        """Return the manifest of every file of the draft, once each is known to be there."""
        arrays = self._arrays()
        if not arrays:
            raise IncompleteDraft(f"the draft of {self.recipe.stage} has no array: create and write one")
        paths = [f"{DATA}/zarr.json"]
        for name in arrays:
            paths += [f"{DATA}/{name}/zarr.json", *self._chunks(name)]
        found = dict(zip(paths, in_threads(lambda path: self._objects.head(self._path(path)), paths), strict=True))
        return Manifest(tuple(File(path, each.size, each.attributes[_HASH]) for path, each in self._whole(found)))

    def _whole(self, found: Mapping[str, Found | None]) -> Iterable[tuple[str, Found]]:
        """Return the files in order; refuse to publish a draft that lacks some."""
        missing = [path for path, each in found.items() if each is None or _HASH not in each.attributes]
        if missing:
            raise IncompleteDraft(
                f"the draft of {self.recipe.stage} lacks {len(missing)} of {len(found)} files, first {missing[0]}: "
                "write every region before publishing"
            )
        return [(path, each) for path, each in sorted(found.items()) if each]


def discard(objects: Objects, place: str) -> None:
    """Give a draft up and delete its data; of one that was published, forget only that it was a draft.

    Raises:
        CacheUnavailable: if the store refuses.
    """
    mark = objects.get(f"drafts/{place}")
    if mark is None:
        return
    manifest = f"data/{place}/{MANIFEST}"
    if objects.create(manifest, GIVEN_UP) is None:  # it stays there until a cleaning: a writer may be late
        objects.delete(each.path for each in objects.below(f"data/{place}") if each.path != manifest)
    elif _lost(objects, _words(mark)[0], place):
        objects.delete(each.path for each in objects.below(f"data/{place}"))
    objects.delete([f"drafts/{place}"])


def _words(mark: Found) -> list[str]:
    """Return what a draft's mark says: the key, and then the name of each array."""
    return mark.data.decode("ascii", "replace").split() or [""]


def _arrays_of(mark: Found) -> list[str]:
    return _words(mark)[1:]


def _lost(objects: Objects, key: str, place: str) -> bool:
    """Return whether a sealed draft will never be an entry: another one is. If none is, its writer may be about to."""
    try:
        return records.read(objects, key).place != place
    except (EntryNotFound, DamagedEntry, InvalidKey):
        return False


@lru_cache(1024)
def _known(url: str, path: str) -> str:
    """Return the text of an object that never changes.

    Raises:
        KeyError: if it is not there: that is not remembered.
    """
    if (found := connect(url).get(path)) is None:
        raise KeyError(path)
    return found.data.decode("utf-8")


def _metadata(url: str, path: str) -> dict[str, Any] | None:
    try:
        about: dict[str, Any] = json.loads(_known(url, path))
    except KeyError:
        return None
    return about
