import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from zarr.codecs import ZstdCodec

from semidense.cache import Recipe, Store
from semidense.cache.entries.draft import FolderDraft

ATTRS = {"long_name": "a map", "units": "px"}


@pytest.fixture
def draft(store: Store, recipe: Recipe) -> FolderDraft:
    draft = store.begin(recipe, {"scene": "Teddy"})
    assert isinstance(draft, FolderDraft)
    return draft


def written_by_zarr(folder: Path, name: str, data: np.ndarray[Any, Any], chunks: tuple[int, ...], fill: Any) -> None:  # noqa: ANN401
    """Write an array with zarr alone, every chunk of it."""
    array = zarr.open_group(folder, mode="a", zarr_format=3).create_array(
        name,
        shape=data.shape,
        dtype=data.dtype,
        chunks=chunks,
        filters=(),
        compressors=(ZstdCodec(level=1, checksum=True),),
        fill_value=fill,
        dimension_names=("y", "x")[: data.ndim],
        attributes=ATTRS,
        config={"write_empty_chunks": True},
    )
    array[...] = data


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("dtype", ["bool", "int8", "uint16", "int64", "float16", "float32", "float64"])
@pytest.mark.parametrize(
    ("shape", "chunks", "fill"),
    [
        pytest.param((5, 7), (2, 3), None, id="chunks that overhang"),
        pytest.param((5, 7), (2, 3), 1, id="a fill value of its own"),
        pytest.param((4,), (4,), None, id="one chunk"),
        pytest.param((), (), None, id="one number"),
        pytest.param((0, 3), (1, 3), None, id="empty"),
    ],
)
def test_the_files_are_those_that_zarr_writes(
    draft: FolderDraft, tmp_path: Path, dtype: str, shape: tuple[int, ...], chunks: tuple[int, ...], fill: int | None
) -> None:
    ramp = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    data = ramp.T.copy().T  # not contiguous, as a tile cut out of a block
    standard = np.nan if data.dtype.kind == "f" else 0
    for name in ("first", "second"):  # the metadata of the second come from memory
        draft.create_array(name, shape, dtype, chunks, ("y", "x")[: data.ndim], ATTRS, fill)
        draft.write(name, (slice(None),) * data.ndim, data)
        written_by_zarr(tmp_path / "zarr", name, data, chunks, standard if fill is None else fill)
    assert files(draft.path / "data.zarr") == files(tmp_path / "zarr")


def test_a_fill_value_keeps_its_sign(draft: FolderDraft) -> None:
    """0.0 and -0.0 are equal: a memory of metadata could take one for the other."""
    for name, value in (("plus", 0.0), ("minus", -0.0)):
        draft.create_array(name, (1,), "float32", (1,), ("x",), {}, value)
    texts = [(draft.path / f"data.zarr/{name}/zarr.json").read_text() for name in ("plus", "minus")]
    assert [re.findall(r'"fill_value": (\S+),', text) for text in texts] == [["0.0"], ["-0.0"]]
