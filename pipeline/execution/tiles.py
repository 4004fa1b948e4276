"""Cut the inputs of a stage into tiles of rows, with the context that the stage declares."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Union

import numpy as np

from semidense.stages.stage import Array, Params, Stage

if TYPE_CHECKING:
    import zarr


@dataclass(frozen=True)
class Rows:
    """The rows ``start`` to ``stop`` of an image of ``height`` rows: one tile."""

    start: int
    stop: int
    height: int

    def __str__(self) -> str:
        return f"rows {self.start}-{self.stop - 1}"


def cut_rows(height: int, tile_rows: int) -> tuple[Rows, ...]:
    """Return the tiles of an image, from top to bottom; the last may be lower than the others."""
    return tuple(Rows(start, min(start + tile_rows, height), height) for start in range(0, height, tile_rows))


class Labelled(NamedTuple):
    """An array, in memory or unread, and the names of its dimensions."""

    values: Union[Array, "zarr.Array[Any]"]
    dims: tuple[str, ...]


def labelled(arrays: "Mapping[str, zarr.Array[Any]]") -> dict[str, Labelled]:
    """Return the arrays of an entry, unread, with the names of their dimensions."""
    return {name: Labelled(array, dims_of(array)) for name, array in arrays.items()}


def own(values: Union[Array, "zarr.Array[Any]"]) -> Array:
    """Return an array in memory that the caller may change."""
    return values.copy() if isinstance(values, np.ndarray) else np.asarray(values[...])


def read_block(arrays: Mapping[str, Labelled], rows: Rows, stage: Stage, params: Params) -> dict[str, Array]:
    """Return a product's arrays as a tile of ``stage`` needs them.

    Arrays with rows are cut to the tile and its halo; with ``border="edge"`` the nearest pixel stands
    for those beyond the image, on all four sides. Arrays without rows come whole.
    """
    halo = stage.halo(params)
    return {name: _read_rows(array, rows, halo, stage.border == "edge") for name, array in arrays.items()}


def _read_rows(array: Labelled, rows: Rows, halo: int, repeat_edge: bool) -> Array:
    """Return the rows of a tile with its halo; all of an array that has no rows."""
    values, dims = array
    if "y" not in dims:
        return own(values)
    first, last = max(0, rows.start - halo), min(rows.height, rows.stop + halo)
    cut: Array = np.array(values[_index(dims, slice(first, last))], order="C")
    if not repeat_edge:
        return cut
    margins = {"y": (first - rows.start + halo, rows.stop + halo - last), "x": (halo, halo)}
    return np.pad(cut, [margins.get(dim, (0, 0)) for dim in dims], mode="edge")


def dims_of(array: "zarr.Array[Any]") -> tuple[str, ...]:
    """Return the names of an array's dimensions."""
    return tuple(str(name) for name in getattr(array.metadata, "dimension_names", None) or ())


def trim(arrays: Mapping[str, Array], dims: Mapping[str, tuple[str, ...]], rows: Rows, halo: int) -> dict[str, Array]:
    """Return the tile's own rows of what a stage made of a block that brought ``halo`` rows of context."""
    first = rows.start - max(0, rows.start - halo)
    own = slice(first, first + rows.stop - rows.start)
    return {name: array[_index(dims[name], own)] for name, array in arrays.items()}


def _index(dims: tuple[str, ...], rows: slice) -> tuple[Any, ...]:
    return tuple(rows if dim == "y" else slice(None) for dim in dims)
