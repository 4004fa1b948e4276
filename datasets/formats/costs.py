"""Read a cost volume that another matcher made: a NumPy file (y, x, d), lower is better, NaN where there is no cell."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from semidense.datasets.errors import DatasetError, MissingFileError

LARGEST = float(np.finfo(np.float16).max)
"""Costs are stored as float16."""


def costs_shape(path: Path) -> tuple[int, int, int]:
    """Return rows, columns and number of disparities of a volume, from the file's header.

    Raises:
        MissingFileError: If the file cannot be read.
        DatasetError: If it is no NumPy array (y, x, d) of floating point numbers.
    """
    rows, columns, count = _opened(path).shape
    return rows, columns, count


def read_costs(path: Path) -> NDArray[np.float16]:
    """Read a volume (y, x, d).

    Raises:
        MissingFileError: If the file cannot be read.
        DatasetError: If it is no volume, holds infinite costs, or costs that float16 cannot hold.
    """
    costs = _opened(path)
    if np.isinf(costs).any() or np.nanmax(np.abs(costs), initial=0) > LARGEST:
        raise DatasetError(f"{path}: a cost is infinite or beyond {LARGEST:g}; mark missing cells with NaN, or scale")
    return costs.astype(np.float16)


def _opened(path: Path) -> NDArray[Any]:
    try:
        costs: NDArray[Any] = open_memmap(path, mode="r")  # unlike np.load, it takes .npy alone
    except OSError as error:
        raise MissingFileError(f"{path}: cannot be read ({error.strerror or error})") from error
    except ValueError as error:
        raise DatasetError(f"{path}: this is not a NumPy file (.npy) of a cost volume ({error})") from error
    if costs.ndim != 3 or costs.dtype.kind != "f" or not costs.size:
        raise DatasetError(f"{path}: {costs.dtype} {costs.shape}; a cost volume has dims y, x, d in floating point")
    return costs
