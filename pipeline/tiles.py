"""Cut the inputs of a stage into tiles of rows, with the context that the stage declares."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from stages.stage import Array, Params, Stage

if TYPE_CHECKING:
    import xarray as xr


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


def read_block(dataset: "xr.Dataset", rows: Rows, stage: Stage, params: Params) -> dict[str, Array]:
    """Return a product's arrays as a tile of ``stage`` needs them.

    Arrays with rows are cut to the tile and its halo; with ``border="edge"`` the nearest pixel stands
    for those beyond the image, on all four sides. Arrays without rows come whole.
    """
    halo = stage.halo(params)
    block = {}
    for name, array in dataset.variables.items():
        if "y" in array.dims:
            first, last = max(0, rows.start - halo), min(rows.height, rows.stop + halo)
            values = array.isel(y=slice(first, last)).values
            if stage.border == "edge":
                above, below = halo - (rows.start - first), halo - (last - rows.stop)
                margins = {"y": (above, below), "x": (halo, halo)}
                values = np.pad(values, [margins.get(str(dim), (0, 0)) for dim in array.dims], mode="edge")
            block[str(name)] = values
        else:
            block[str(name)] = array.values
    return block


def trim(arrays: Mapping[str, Array], dims: Mapping[str, tuple[str, ...]], rows: Rows, halo: int) -> dict[str, Array]:
    """Return the tile's own rows of what a stage made of a block that brought ``halo`` rows of context."""
    first = rows.start - max(0, rows.start - halo)
    own = slice(first, first + rows.stop - rows.start)
    return {name: array[_index(dims[name], own)] for name, array in arrays.items()}


def _index(dims: tuple[str, ...], rows: slice) -> tuple[Any, ...]:
    return tuple(rows if dim == "y" else slice(None) for dim in dims)
