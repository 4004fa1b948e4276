"""A small result in memory, encoded: the bytes of its files and their digest, yet to be published."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from semidense.cache.document import plain_mapping
from semidense.cache.entries.arrays import (
    array_metadata,
    chunks_of,
    encoded,
    group_metadata,
    require_dtype,
    require_fit,
)
from semidense.cache.entries.entry import DATA, Entry, File, Manifest
from semidense.cache.keys.recipe import Recipe, require_texts

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Values(NamedTuple):
    """An array of a result, with what ``Draft.create_array`` is told of one."""

    array: "NDArray[Any]"
    chunks: Sequence[int]
    dims: Sequence[str]
    attrs: Mapping[str, Any]


@dataclass(frozen=True)
class Encoded:
    """A result whose digest is known and which nobody sees yet; ``Store.publish_all`` takes several of one writer.

    Attributes:
        recipe: what it is made from.
        label: what people call it.
        files: the bytes of each file, by its path inside the entry.
        manifest: of these files.
        seconds: what making it took.
        extras: JSON only: further provenance.
        maker: as for ``Store.begin``.
    """

    recipe: Recipe
    label: Mapping[str, str]
    files: Mapping[str, bytes]
    manifest: Manifest
    seconds: float
    extras: Mapping[str, Any]
    maker: str = ""

    @property
    def digest(self) -> str:
        """The output digest, for the recipes of what is made from it."""
        return self.manifest.digest

    def entry(self) -> Entry:
        """Return the entry that this becomes, published now."""
        return Entry.now(self.recipe, self.label, self.manifest, self.seconds, self.extras)


def encode(
    recipe: Recipe,
    label: Mapping[str, str],
    arrays: Mapping[str, Values],
    seconds: float,
    extras: Mapping[str, Any],
    maker: str = "",
) -> Encoded:
    """Return a result with the very files that a draft of these arrays would have.

    Raises:
        InvalidArray: if an array is not as ``Draft.create_array`` and ``Draft.write`` ask for.
        InvalidRecipe: if the label does not map text to text, or ``attrs`` hold what JSON cannot.
    """
    require_texts("label", label)
    files, sizes = {f"{DATA}/zarr.json": group_metadata()}, dict[str, Mapping[str, int]]()
    for name, (array, chunks, dims, attrs) in arrays.items():
        kind = require_dtype(name, str(array.dtype))
        require_fit(recipe.stage, sizes, name, array.shape, chunks, dims)
        sizes[name] = dict(zip(dims, array.shape, strict=True))
        files[f"{DATA}/{name}/zarr.json"] = about = array_metadata(array.shape, kind, chunks, dims, attrs, None)
        region = tuple(slice(0, length) for length in array.shape)
        for path, chunk in chunks_of(f"array {name!r} of {recipe.stage}", about, region, array):
            files[f"{DATA}/{name}/{path}"] = encoded(chunk)
    rows = [File(path, len(data), hashlib.sha256(data).hexdigest()) for path, data in sorted(files.items())]
    return Encoded(recipe, plain_mapping("label", label), files, Manifest(tuple(rows)), seconds, extras, maker)
