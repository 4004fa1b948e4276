"""Describe the arrays of an entry and encode their chunks; refuse arrays and regions that cannot be written."""

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any

from semidense.cache.document import canonical, parse
from semidense.cache.errors import InvalidArray

if TYPE_CHECKING:
    import numpy as np
    import zarr
    from numpy.typing import NDArray

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)
"""The names that arrays can have."""
ZSTD_LEVEL = 1
"""Higher levels cost more time than they save space on float maps and float16 volumes."""


def chunk_paths(shape: Sequence[int], chunks: Sequence[int], region: Sequence[slice] | None = None) -> Iterator[str]:
    """Yield the path of every chunk of an array, or of a region of whole chunks, relative to the array's folder."""
    parts = region or [slice(None)] * len(shape)
    ranges = [
        range((part.start or 0) // chunk, -(-(length if part.stop is None else part.stop) // chunk))
        for part, length, chunk in zip(parts, shape, chunks, strict=True)
    ]
    return ("/".join(("c", *map(str, place))) for place in product(*ranges))


def require_dtype(name: str, dtype: str) -> "np.dtype[Any]":
    """Return the NumPy type if arrays of it can be stored bit for bit."""
    import numpy as np

    try:
        kind = np.dtype(dtype)
    except TypeError:
        raise InvalidArray(f"array {name!r}: {dtype!r} is no NumPy type") from None
    if kind.kind not in "biuf" or not kind.isnative or kind.itemsize > 8:
        raise InvalidArray(f"array {name!r}: {dtype!r} cannot be stored: use bool, an integer or a float type")
    return kind


def require_fit(
    stage: str,
    others: Mapping[str, Mapping[str, int]],
    name: str,
    shape: Sequence[int],
    chunks: Sequence[int],
    dims: Sequence[str],
) -> None:
    """Refuse an array that could not be opened together with the others, given the lengths of their dimensions."""
    where = f"array {name!r} of {stage}"
    if not NAME.fullmatch(name) or name in others:
        raise InvalidArray(f"{where}: the name is taken, or not made of letters, digits and _")
    if not len(shape) == len(chunks) == len(dims) == len(set(dims)):
        raise InvalidArray(f"{where}: shape {shape}, chunks {chunks} and dims {dims} must have one item a dimension")
    if any(size < 0 for size in shape) or any(chunk < 1 for chunk in chunks):
        raise InvalidArray(f"{where}: shape {shape} must not be negative, and chunks {chunks} must be positive")
    sizes = {dim: size for other in others.values() for dim, size in other.items()}
    for dim, size in zip(dims, shape, strict=True):
        if sizes.get(dim, size) != size:
            raise InvalidArray(f"{where}: {dim} has length {size}, in another array of the draft {sizes[dim]}")


def array_metadata(
    shape: Sequence[int],
    kind: "np.dtype[Any]",
    chunks: Sequence[int],
    dims: Sequence[str],
    attrs: Mapping[str, Any],
    fill_value: float | None,
) -> bytes:
    """Return the metadata file of an array of the one form that this cache writes."""
    cut = tuple(max(1, min(chunk, size)) for chunk, size in zip(chunks, shape, strict=True))
    if fill_value is not None:  # not remembered: 0.0 and -0.0 are equal, their metadata are not
        return _spell_metadata(tuple(shape), kind, cut, tuple(dims), canonical(attrs), fill_value)
    return _metadata_of(tuple(shape), kind, cut, tuple(dims), canonical(attrs))


@lru_cache(256)
def _metadata_of(
    shape: tuple[int, ...], kind: "np.dtype[Any]", chunks: tuple[int, ...], dims: tuple[str, ...], attrs: str
) -> bytes:
    """As ``array_metadata``, once for all arrays of a form: the scenes of a data set share theirs."""
    return _spell_metadata(shape, kind, chunks, dims, attrs, kind.type("nan" if kind.kind == "f" else 0))


def _spell_metadata(
    shape: tuple[int, ...],
    kind: "np.dtype[Any]",
    chunks: tuple[int, ...],
    dims: tuple[str, ...],
    attrs: str,
    fill_value: Any,  # noqa: ANN401 - a number, of Python or NumPy
) -> bytes:
    """Have zarr create an array in memory, and return its metadata file."""
    import zarr
    from zarr.codecs import ZstdCodec
    from zarr.storage import MemoryStore

    memory: dict[str, Any] = {}
    zarr.create_array(
        MemoryStore(memory),
        zarr_format=3,
        shape=shape,
        dtype=kind,
        chunks=chunks,
        filters=(),
        compressors=(ZstdCodec(level=ZSTD_LEVEL, checksum=True),),
        fill_value=fill_value,
        dimension_names=dims,
        attributes=parse(attrs),
    )
    return bytes(memory["zarr.json"].to_bytes())


@lru_cache(1)
def group_metadata() -> bytes:
    """Return the metadata file of the group that an entry's arrays are in."""
    import zarr
    from zarr.storage import MemoryStore

    memory: dict[str, Any] = {}
    zarr.create_group(MemoryStore(memory), zarr_format=3)
    return bytes(memory["zarr.json"].to_bytes())


@lru_cache(256)
def _described(metadata: bytes) -> "zarr.Array[Any]":
    """Return an array without chunks from its metadata file, to ask for its shape, chunks, type and fill value."""
    import zarr
    from zarr.core.buffer import default_buffer_prototype
    from zarr.storage import MemoryStore

    memory = {"zarr.json": default_buffer_prototype().buffer.from_bytes(metadata)}
    return zarr.open_array(MemoryStore(memory), mode="r", zarr_format=3)


def chunks_of(
    where: str, metadata: bytes, region: tuple[slice, ...], data: "NDArray[Any]"
) -> "Iterator[tuple[str, NDArray[Any]]]":
    """Return each chunk of a region: its path relative to the array's folder, and its values, filled up at the end.

    Args:
        where: names the array in errors.
        metadata: the array's metadata file.
        region: as for ``Draft.write``.
        data: of the region.

    Raises:
        InvalidArray: at once, if the region is not made of whole chunks or the data do not fit it.
    """
    array = _described(metadata)
    bounds = require_region(where, array, region, data)
    steps = [range(0, part.stop - part.start, chunk) for part, chunk in zip(bounds, array.chunks, strict=True)]
    blocks = (_whole_chunk(array, data[_corner(start, array.chunks)]) for start in product(*steps))
    return zip(chunk_paths(array.shape, array.chunks, bounds), blocks, strict=True)


def _corner(start: Sequence[int], chunks: Sequence[int]) -> tuple[slice, ...]:
    return tuple(slice(first, first + length) for first, length in zip(start, chunks, strict=True))


def _whole_chunk(array: "zarr.Array[Any]", block: "NDArray[Any]") -> "NDArray[Any]":
    """Return a block in the shape of a chunk: beyond the array's end lies the fill value."""
    import numpy as np

    if block.shape == array.chunks:
        return block
    whole = np.full(array.chunks, array.fill_value, array.dtype)
    whole[tuple(slice(length) for length in block.shape)] = block
    return whole


def encoded(chunk: "NDArray[Any]") -> bytes:
    """Return the file of a chunk: the bytes that zarr writes, without a wait for its event loop."""
    import numpy as np
    from numcodecs.zstd import Zstd

    plain = np.ascontiguousarray(chunk, chunk.dtype.newbyteorder("<"))
    return bytes(Zstd(level=ZSTD_LEVEL, checksum=True).encode(plain.reshape(-1).view(np.uint8)))


def decoded(data: bytes, kind: "np.dtype[Any]") -> "NDArray[Any]":
    """Return the values of a chunk's file in one row, to be changed by the caller; its own checksum is compared."""
    import numpy as np
    from numcodecs.zstd import Zstd

    plain = np.frombuffer(bytearray(Zstd().decode(data)), kind.newbyteorder("<"))
    return plain.astype(kind, copy=False)


def require_region(
    where: str, array: "zarr.Array[Any]", region: tuple[slice, ...], data: "NDArray[Any]"
) -> tuple[slice, ...]:
    """Return the region with its bounds if it is made of whole chunks, and the data fit it."""
    bounds = require_aligned(where, array, region)
    expected = tuple(stop - start for start, stop in bounds)
    if data.shape != expected or data.dtype != array.dtype:
        raise InvalidArray(
            f"{where}: the data are {data.dtype} {data.shape}, the region takes {array.dtype} {expected}"
        )
    return tuple(slice(*pair) for pair in bounds)


def require_aligned(where: str, array: "zarr.Array[Any]", region: tuple[slice, ...]) -> list[tuple[int, int]]:
    """Return the region's (start, stop) a dimension if it is made of whole chunks."""
    if len(region) != array.ndim:
        raise InvalidArray(f"{where}: the region has {len(region)} dimensions, the array {array.ndim}")
    bounds = []
    for part, size, chunk in zip(region, array.shape, array.chunks, strict=True):
        start, stop = part.start or 0, size if part.stop is None else part.stop
        inside = part.step in (None, 1) and 0 <= start <= stop <= size
        if not inside or start % chunk or (stop % chunk and stop != size):
            raise InvalidArray(f"{where}: {part} is not made of whole chunks of {chunk} within {size}: align the tiles")
        bounds.append((start, stop))
    return bounds
