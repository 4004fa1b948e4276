"""Create arrays and list their files; check that imported arrays have the format ``Draft`` writes."""

import json
import math
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semidense.cache.document import canonical, parse
from semidense.cache.entries.entry import DATA, Manifest
from semidense.cache.errors import InvalidArray

if TYPE_CHECKING:
    import numpy as np
    import zarr
    from numpy.typing import NDArray

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)
"""The names that arrays can have."""
ZSTD_LEVEL = 1
"""Higher levels cost more time than they save space on float maps and float16 volumes."""
LARGEST_CHUNK = 1 << 32
"""Bytes of one decoded chunk: a reader holds at least one in memory."""
_FIELDS = {
    "shape", "data_type", "chunk_grid", "chunk_key_encoding", "fill_value", "codecs", "attributes", "dimension_names",
    "zarr_format", "node_type", "storage_transformers",
}  # fmt: skip
_TYPE = re.compile(r"(?:bool|u?int(8|16|32|64)|float(16|32|64))", re.ASCII)
_LARGEST_METADATA = 1 << 20
_MAGIC = 0xFD2FB528


def check_arrays(folder: Path, manifest: Manifest, largest: int) -> None:
    """Refuse an unpacked entry that is not a group of arrays as ``Draft`` writes them.

    Codecs other than bytes and zstd are refused, since a codec is code; so are chunks that would decode to
    another size than the array's, which bounds what reading can allocate.

    Args:
        folder: the entry's, its files already compared with the manifest.
        manifest: its files.
        largest: bytes of all arrays together, decoded.

    Raises:
        ValueError: saying what is wrong.
    """
    paths = {file.path for file in manifest.files}
    names = sorted({path.split("/")[1] for path in paths} - {"zarr.json"})
    group = _metadata(folder / DATA / "zarr.json") if f"{DATA}/zarr.json" in paths else {}
    if group.get("node_type") != "group" or group.get("zarr_format") != 3 or not names:
        raise ValueError("its arrays are in no zarr v3 group")
    expected, total = {f"{DATA}/zarr.json"}, 0
    for name in names:
        if f"{DATA}/{name}/zarr.json" not in paths:
            raise ValueError(f"{name} is no array")
        total += _check_array(folder, name, paths, expected)
        if total > largest:
            raise ValueError(f"its arrays have more than {largest:,} bytes once decoded")
    if paths != expected:
        raise ValueError(f"{min(paths ^ expected)} is {'missing' if min(paths ^ expected) in expected else 'no chunk'}")


def chunk_paths(shape: Sequence[int], chunks: Sequence[int], region: Sequence[slice] | None = None) -> Iterator[str]:
    """Yield the path of every chunk of an array, or of a region of whole chunks, relative to the array's folder."""
    parts = region or [slice(None)] * len(shape)
    ranges = [
        range((part.start or 0) // chunk, -(-(length if part.stop is None else part.stop) // chunk))
        for part, length, chunk in zip(parts, shape, chunks, strict=True)
    ]
    return ("/".join(("c", *map(str, place))) for place in product(*ranges))


def _counts(shape: Sequence[int], chunks: Sequence[int]) -> list[int]:
    """Return how many chunks there are along each dimension."""
    return [-(-length // chunk) for length, chunk in zip(shape, chunks, strict=True)]


def _metadata(path: Path) -> dict[str, Any]:
    if path.stat().st_size > _LARGEST_METADATA:
        raise ValueError(f"{path.name} has more than {_LARGEST_METADATA:,} bytes")
    return parse(path.read_bytes().decode("utf-8"))


def _check_array(folder: Path, name: str, paths: set[str], expected: set[str]) -> int:
    """Check an array's metadata and chunks, add its files to ``expected``; return its bytes once decoded."""
    about = _metadata(folder / DATA / name / "zarr.json")
    shape, chunks, item = _geometry(name, about)
    size, chunk_size = math.prod(shape) * item, math.prod(chunks) * item
    if chunk_size > LARGEST_CHUNK:
        sides = " x ".join(map(str, chunks))
        raise ValueError(f"a chunk of {name} would be {sides} x {item} = {chunk_size:,} bytes, above {LARGEST_CHUNK:,}")
    count = math.prod(_counts(shape, chunks))
    if count > len(paths):
        raise ValueError(f"{name} would have {count:,} chunks, the entry has {len(paths):,} files")
    expected.add(f"{DATA}/{name}/zarr.json")
    for chunk in chunk_paths(shape, chunks):
        path = f"{DATA}/{name}/{chunk}"
        expected.add(path)
        if path in paths and (found := _decoded_size(folder / path)) != chunk_size:
            raise ValueError(f"{path} would decode to {found} bytes, its array says {chunk_size:,}")
    return size


def _geometry(name: str, about: dict[str, Any]) -> tuple[list[int], list[int], int]:
    """Return shape, chunk shape and bytes an item of an array of the one form that is written here."""
    codecs = [(codec.get("name"), codec.get("configuration", {})) for codec in _dicts(about.get("codecs"))]
    match = _TYPE.fullmatch(str(about.get("data_type")))
    encoding = about.get("chunk_key_encoding")
    if (
        set(about) - _FIELDS
        or (about.get("zarr_format"), about.get("node_type"), about.get("storage_transformers", [])) != (3, "array", [])
        or match is None
        or [codec for codec, _ in codecs] != ["bytes", "zstd"]
        or codecs[0][1] not in ({}, {"endian": "little"})
        or codecs[1][1].get("checksum") is not True
        or encoding != {"name": "default", "configuration": {"separator": "/"}}
        or isinstance(about.get("fill_value"), (list, dict))
    ):
        raise ValueError(f"{name} is not an array as this cache writes them: {json.dumps(about)[:80]}")
    grid = about.get("chunk_grid") or {}
    shape = _lengths(name, about.get("shape"), 0)
    chunks = _lengths(name, (grid.get("configuration") or {}).get("chunk_shape"), 1)
    if grid.get("name") != "regular" or len(shape) != len(chunks):
        raise ValueError(f"{name} has shape {shape} and chunks {chunks}")
    return shape, chunks, int(match[1] or match[2] or 8) // 8


def _dicts(value: object) -> Iterator[dict[str, Any]]:
    for item in value if isinstance(value, list) else ():
        yield item if isinstance(item, dict) else {}


def _lengths(name: str, value: object, least: int) -> list[int]:
    if not isinstance(value, list) or any(type(length) is not int or length < least for length in value):
        raise ValueError(f"{name} has a shape or chunks that are none")
    return value


def _decoded_size(path: Path) -> int | None:
    """Return the size that a zstd frame says it decodes to; None if it does not say, or is no frame."""
    with path.open("rb") as file:
        head = file.read(18)
    if len(head) < 6 or struct.unpack_from("<I", head)[0] != _MAGIC:
        return None
    flags = head[4]
    single = flags >> 5 & 1
    at = 5 + (0 if single else 1) + (0, 1, 2, 4)[flags & 3]
    width = (1 if single else 0, 2, 4, 8)[flags >> 6]
    if not width or len(head) < at + width:
        return None
    return int.from_bytes(head[at : at + width], "little") + (256 if width == 2 else 0)


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


def new_array(
    place: Any,  # noqa: ANN401 - a path, or a place in one of zarr's stores
    shape: Sequence[int],
    kind: "np.dtype[Any]",
    chunks: Sequence[int],
    dims: Sequence[str],
    attrs: Mapping[str, Any],
    fill_value: float | None,
) -> "zarr.Array[Any]":
    """Create an array of the one form that this cache writes."""
    import numpy as np
    import zarr
    from zarr.codecs import ZstdCodec

    return zarr.create_array(
        place,
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
