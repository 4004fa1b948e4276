"""Check that the arrays of an imported entry have the format that ``Draft`` writes, before any is decoded."""

import json
import math
import re
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from semidense.cache.document import parse
from semidense.cache.entries.arrays import chunk_paths
from semidense.cache.entries.entry import DATA, Manifest

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
