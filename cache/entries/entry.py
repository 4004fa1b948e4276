"""What a published result is: its record, and the manifest of its files.

Both are read strictly: what does not have exactly the written form is damaged.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any, Self

from semidense.cache.document import Json, digest_of_plain, plain_mapping, seal_plain, unseal
from semidense.cache.errors import CacheError, DamagedEntry, InvalidRecipe
from semidense.cache.keys.recipe import Recipe, require_texts

DATA = "data.zarr"
MANIFEST = "manifest.json"
_PATH = re.compile(r"data\.zarr(/[A-Za-z0-9_]([A-Za-z0-9._-]*))+", re.ASCII)
_SHA256 = re.compile(r"[0-9a-f]{64}", re.ASCII)


@dataclass(frozen=True, order=True)
class File:
    """One file of an entry: its path inside the entry, its size in bytes and its sha256."""

    path: str
    size: int
    sha256: str

    def __post_init__(self) -> None:
        """Refuse a path that could lead outside the entry, and what is no size or hash."""
        if not isinstance(self.path, str) or not _PATH.fullmatch(self.path):
            raise ValueError(f"the path {self.path!r} is not one inside an entry")
        if type(self.size) is not int or self.size < 0:
            raise ValueError(f"the size {self.size!r} of {self.path} is not one")
        require_sha256(f"the hash of {self.path}", self.sha256)


def require_sha256(name: str, value: object) -> None:
    """Refuse what is not a sha256 in lower-case hexadecimal.

    Raises:
        ValueError: naming what it is.
    """
    if not isinstance(value, str) or not _SHA256.fullmatch(value):
        raise ValueError(f"{name} is not a sha256: {value!r}")


def folders_of(paths: Iterable[str]) -> frozenset[str]:
    """Return the folders that some files are in, and theirs."""
    found: set[str] = set()
    for path in paths:
        folder = path
        while (folder := folder.rpartition("/")[0]) and folder not in found:
            found.add(folder)
    return frozenset(found)


@dataclass(frozen=True)
class Manifest:
    """Every file of an entry, sorted by path; all that is read of an entry is read through it.

    Attributes:
        files: the files.
        digest: the output digest: sha256 over the sorted (path, size, sha256).
    """

    files: tuple[File, ...]
    digest: str = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Refuse files out of order and a path named twice; work out the digest."""
        paths = [file.path for file in self.files]
        if any(first >= second for first, second in pairwise(paths)):
            raise ValueError("its paths are not sorted, or one is repeated")
        object.__setattr__(self, "digest", digest_of_plain(self._rows()))

    @property
    def folders(self) -> frozenset[str]:
        """The folders that the files are in, and theirs."""
        return folders_of(file.path for file in self.files)

    @property
    def size(self) -> int:
        """Bytes of all files together."""
        return sum(file.size for file in self.files)

    def _rows(self) -> list[Json]:
        """Return the files as JSON rows."""
        return [[file.path, file.size, file.sha256] for file in self.files]

    def to_bytes(self) -> bytes:
        """Return the manifest's file."""
        return seal_plain("manifest", {"files": self._rows()})

    @classmethod
    def from_bytes(cls, data: bytes) -> Self:
        """Read a manifest's file.

        Raises:
            DamagedEntry: if one byte differs from what was written.
        """
        try:
            rows = _fields(unseal("manifest", data), {"files"})["files"]
            if not isinstance(rows, list) or any(not isinstance(row, list) or len(row) != 3 for row in rows):
                raise ValueError("its files are not rows of path, size and hash")
            return cls(tuple(File(*row) for row in rows))
        except (ValueError, RecursionError) as error:
            raise DamagedEntry(f"the manifest is damaged: {error}") from None


def _fields(content: dict[str, Any], names: set[str]) -> dict[str, Any]:
    """Refuse missing and unknown fields."""
    if set(content) != names:
        raise ValueError(f"its fields are {sorted(content)}, expected {sorted(names)}")
    return content


@dataclass(frozen=True)
class Entry:
    """A published result, as its record tells.

    Attributes:
        key: the recipe's key.
        recipe: what it is made from.
        digest: the output digest, of the content alone; what is made from this entry has it in its key.
        label: what people call it, such as product, dataset and scene; not part of the key.
        created: time of publishing, ISO 8601 in UTC.
        seconds: time of making.
        size: bytes of all its files.
        extras: further provenance, such as versions and command line; not part of the key.

    Raises:
        InvalidRecipe: if a field is not what is said here, or the recipe has another key.
    """

    key: str
    recipe: Recipe
    digest: str
    label: Mapping[str, str]
    created: str
    seconds: float
    size: int
    extras: Mapping[str, Any]

    def __post_init__(self) -> None:
        """Check the fields and reduce the mappings to plain JSON types."""
        require_texts("label", self.label)
        object.__setattr__(self, "label", plain_mapping("label", self.label))
        object.__setattr__(self, "extras", plain_mapping("extras", self.extras))
        if type(self.created) is not str or type(self.seconds) is not float or type(self.size) is not int:
            raise InvalidRecipe("created, seconds and size must be a text, a float and an int")
        if self.key != self.recipe.key:
            raise InvalidRecipe(f"the recipe's key is {self.recipe.key}, not {self.key}")

    @classmethod
    def now(
        cls, recipe: Recipe, label: Mapping[str, str], manifest: "Manifest", seconds: float, extras: Mapping[str, Any]
    ) -> Self:
        """Return the entry of a manifest's files, published now."""
        created = datetime.now(UTC).isoformat(timespec="microseconds")
        return cls(recipe.key, recipe, manifest.digest, label, created, float(seconds), manifest.size, extras)

    def provenance(self) -> dict[str, Any]:
        """Return where the entry comes from, as plain JSON types, for the attributes of its dataset."""
        about = {name: getattr(self, name) for name in _NAMES if name != "recipe"}
        return {**about, **self.recipe.to_dict()}

    def to_bytes(self) -> bytes:
        """Return the record's file."""
        content = {name: getattr(self, name) for name in _NAMES} | {"recipe": self.recipe.to_dict()}
        return seal_plain("entry", content)

    @classmethod
    def from_bytes(cls, key: str, data: bytes) -> Self:
        """Read the record of ``key``.

        Raises:
            DamagedEntry: if one byte differs from what was written, or it is the record of another key.
        """
        try:
            content = _fields(unseal("entry", data), set(_NAMES))
            require_sha256("its digest", content["digest"])
            if content["key"] != key:
                raise ValueError(f"it is the record of {content['key']!r}")
            return cls(**{**content, "recipe": Recipe.from_dict(content["recipe"])})
        except (ValueError, CacheError, RecursionError) as error:
            raise DamagedEntry(f"the record of {key} is damaged: {error}") from None


_NAMES: Sequence[str] = tuple(Entry.__dataclass_fields__)
