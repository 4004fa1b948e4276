"""Read a cost volume that another matcher made: dims y, x, d; lower is better, NaN where there is no cell.

- NumPy (``.npy``): the axes are y, x, d in this order.
- Zarr (a folder): an array, or a group that xarray wrote.
- NetCDF (``.nc``): as xarray wrote it; version 4 of the format needs the package ``h5netcdf``.

Dims that have names are brought into the order y, x, d, and a coordinate ``d`` tells the disparities.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from semidense.datasets.arrays import array_text
from semidense.datasets.errors import DatasetError, MissingFileError

if TYPE_CHECKING:
    import xarray as xr

DIMS = ("y", "x", "d")
LARGEST = float(np.finfo(np.float16).max)
"""Costs are stored as float16."""


@dataclass(frozen=True)
class CostsHeader:
    """What is known of a volume before its costs are read.

    Attributes:
        shape: Rows, columns and number of disparities.
        first: Smallest disparity, px; None if the file does not tell.
    """

    shape: tuple[int, int, int]
    first: int | None


@dataclass(frozen=True)
class _Stored:
    """A volume as its file has it; ``values`` is read by NumPy when it is asked for."""

    dims: tuple[str, ...]
    values: Any
    coordinates: Mapping[str, NDArray[Any]]


def costs_header(path: Path) -> CostsHeader:
    """Return the size and the first disparity of a volume without reading its costs.

    Raises:
        MissingFileError: If the file cannot be read.
        DatasetError: If it is no array with dims y, x, d of floating point numbers, or its coordinates do not fit.
    """
    with _opened(path) as stored:
        rows, columns, count = (stored.values.shape[stored.dims.index(dim)] for dim in DIMS)
        disparities = stored.coordinates.get("d")
        return CostsHeader((rows, columns, count), None if disparities is None else int(disparities[0]))


def read_costs(path: Path) -> NDArray[np.float16]:
    """Read a volume (y, x, d).

    Raises:
        MissingFileError: If the file cannot be read.
        DatasetError: If it is no volume, holds infinite costs, or costs that float16 cannot hold.
    """
    with _opened(path) as stored:
        costs = np.asarray(stored.values).transpose([stored.dims.index(dim) for dim in DIMS])
        if np.isinf(costs).any() or np.nanmax(np.abs(costs), initial=0) > LARGEST:
            raise DatasetError(
                f"{path}: a cost is infinite or beyond {LARGEST:g}; mark missing cells with NaN, or scale"
            )
        return costs.astype(np.float16)


@contextmanager
def _opened(path: Path) -> Iterator[_Stored]:
    """Open a volume of any of the formats, and check it."""
    if path.is_dir():
        yield _checked(path, _zarr(path))
    elif path.suffix.lower() == ".nc":
        with _netcdf(path) as dataset:
            yield _checked(path, _only_volume(path, dataset))
    else:
        yield _checked(path, _Stored(DIMS, _memory_map(path), {}))


def _memory_map(path: Path) -> NDArray[Any]:
    try:
        costs: NDArray[Any] = open_memmap(path, mode="r")  # unlike np.load, it takes .npy alone
    except OSError as error:
        raise MissingFileError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (ValueError, SyntaxError, TokenError) as error:
        raise DatasetError(f"{path}: this is not a NumPy file (.npy) of a cost volume ({error})") from error
    return costs


def _zarr(path: Path) -> _Stored:
    import xarray as xr
    import zarr

    try:
        stored = zarr.open(path, mode="r")
        if isinstance(stored, zarr.Array):
            return _Stored(getattr(stored.metadata, "dimension_names", None) or DIMS, stored, {})
        return _only_volume(path, xr.open_zarr(path, consolidated=False, chunks=None))
    except (OSError, ValueError, KeyError, TypeError) as error:
        if isinstance(error, DatasetError):
            raise
        raise DatasetError(f"{path}: this folder is no Zarr array or group that can be read") from error


def _netcdf(path: Path) -> "xr.Dataset":
    import xarray as xr

    try:
        return xr.open_dataset(path)
    except OSError as error:
        raise MissingFileError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (ValueError, TypeError) as error:
        raise DatasetError(
            f"{path}: this is not a NetCDF file that can be read; version 4 of the format needs h5netcdf: "
            "pip install h5netcdf"
        ) from error


def _only_volume(path: Path, dataset: "xr.Dataset") -> _Stored:
    """Return the only variable of three dims."""
    found = [variable for variable in dataset.data_vars.values() if variable.ndim == len(DIMS)]
    if len(found) != 1:
        raise DatasetError(
            f"{path}: {len(found)} variables with three dims, of {', '.join(map(str, dataset.data_vars)) or 'none'}; "
            "a cost volume is the only one, with dims y, x, d"
        )
    coordinates = {str(dim): found[0][dim].to_numpy() for dim in found[0].dims if dim in dataset.coords}
    return _Stored(tuple(map(str, found[0].dims)), found[0].variable, coordinates)


def _checked(path: Path, stored: _Stored) -> _Stored:
    values = stored.values
    if len(values.shape) != len(DIMS) or values.dtype.kind != "f" or not all(values.shape):
        raise DatasetError(f"{path}: {array_text(values)}; a cost volume has dims y, x, d in floating point")
    if set(stored.dims) != set(DIMS):
        raise DatasetError(f"{path}: dims {', '.join(map(str, stored.dims))}; rename them to y, x, d")
    for dim, places in stored.coordinates.items():
        if places.dtype.kind not in "iuf":
            raise DatasetError(f"{path}: the coordinate {dim} is {places.dtype}; expected numbers")
        if not (np.diff(places) > 0).all():
            raise DatasetError(f"{path}: the coordinate {dim} does not rise; sort by it: sortby({dim!r})")
    disparities = stored.coordinates.get("d", np.arange(1))
    if not np.array_equal(disparities, np.arange(len(disparities)) + np.rint(disparities[0])):
        raise DatasetError(f"{path}: the coordinate d is not whole disparities one px apart, such as 0, 1, 2")
    return stored
