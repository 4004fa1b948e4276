"""Arrays are opened and small ones decoded without zarr's event loop: what is read is what zarr reads."""

from typing import Any

import numpy as np
import pytest
import zarr

from semidense.cache import DamagedEntry, Recipe, Store
from semidense.cache.entries.reader import values_of
from tests.faults.damage import flips, overwrite, unlock

ARRAYS = {
    "single": np.arange(-6, 6, dtype=np.float32).reshape(3, 4),
    "chunked": np.arange(35, dtype=np.int64).reshape(7, 5),
    "scalar": np.array(7, np.uint8),
    "flags": np.array([True, False, True]),
    "half": np.array([[np.nan, -0.0, 65504]], np.float16),
    "empty": np.zeros((0, 3), np.float64),
}
CHUNKS = {"chunked": [2, 5]}


@pytest.fixture
def filled_store(store: Store, recipe: Recipe) -> Store:
    with store.begin(recipe, {"product": "square"}) as draft:
        for name, array in ARRAYS.items():
            chunks = CHUNKS.get(name, [max(1, length) for length in array.shape])
            dims = [f"{name}{axis}" for axis in range(array.ndim)]
            draft.create_array(name, array.shape, str(array.dtype), chunks, dims, {"units": "px"})
            draft.write(name, tuple(slice(0, length) for length in array.shape), array)
        draft.publish(0.0, {})
    return store


def test_arrays_are_opened_as_zarr_opens_them(filled_store: Store, recipe: Recipe) -> None:
    group = zarr.open_group(filled_store.layout.entry(recipe.key) / "data.zarr", mode="r")
    opened = filled_store.arrays(recipe.key)
    assert set(opened) == set(ARRAYS)
    for name, array in opened.items():
        other: Any = group[name]
        assert repr(array.metadata) == repr(other.metadata)
        np.testing.assert_array_equal(array[...], other[...])


def test_values_are_those_that_were_written_and_the_caller_s_own(filled_store: Store, recipe: Recipe) -> None:
    for name, values in filled_store.read(recipe.key).items():
        assert (values.dtype, values.shape) == (ARRAYS[name].dtype, ARRAYS[name].shape)
        assert values.tobytes() == ARRAYS[name].tobytes()
        values[...] = 0
    assert filled_store.read(recipe.key)["single"].tobytes() == ARRAYS["single"].tobytes()


def test_a_flipped_bit_never_reads_as_another_value_even_unchecked(filled_store: Store, recipe: Recipe) -> None:
    array = Store(filled_store.root, "size").arrays(recipe.key)["single"]
    unlock(filled_store, recipe.key)
    path = filled_store.layout.entry(recipe.key) / "data.zarr/single/c/0/0"
    for _ in flips(path):
        try:
            values = values_of(array)
        except Exception:  # noqa: BLE001 - whatever the codec says, it is an error
            continue
        np.testing.assert_array_equal(values, ARRAYS["single"])


def test_a_chunk_that_changes_its_size_while_it_is_open_is_damage(filled_store: Store, recipe: Recipe) -> None:
    array = filled_store.arrays(recipe.key)["single"]
    unlock(filled_store, recipe.key)
    path = filled_store.layout.entry(recipe.key) / "data.zarr/single/c/0/0"
    overwrite(path, path.read_bytes()[:-1])
    with pytest.raises(DamagedEntry, match="changed or vanished"):
        values_of(array)
