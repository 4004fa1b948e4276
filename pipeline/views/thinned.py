"""Maps of any size: read a few rows at a time, and shown only as finely as a screen can."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

SHOWN = 1_500_000
"""Pixels of a map that are shown, at most: quarter and half size whole, of larger images every n-th row and column."""
_BLOCK = 2_000_000
"""Elements that are read at a time, about."""


def step_for(height: int, width: int, most: int = SHOWN) -> int:
    """Return n such that every n-th row and column of an image makes at most ``most`` pixels.

    >>> step_for(500, 741), step_for(2000, 3000)
    (1, 2)
    """
    step = max(1, math.isqrt(height * width // most))
    while -(-height // step) * -(-width // step) > most:
        step += 1
    return step


def row_blocks(array: Any) -> Iterator[slice]:  # noqa: ANN401 - zarr's arrays and NumPy's alike
    """Yield the rows of an array (y, ...) in blocks of whole chunks, small enough to hold several."""
    height, chunk = array.shape[0], getattr(array, "chunks", array.shape)[0]
    row = max(1, math.prod(array.shape[1:]))
    rows = max(1, _BLOCK // (row * chunk)) * chunk
    return (slice(start, min(start + rows, height)) for start in range(0, height, rows))


def thinned(array: Any, step: int) -> NDArray[Any]:  # noqa: ANN401
    """Return every ``step``-th row and column of an array (y, x, ...), never holding more than a block of it.

    >>> thinned(np.arange(12).reshape(3, 4), 2).tolist()
    [[0, 2], [8, 10]]
    """
    parts = [np.asarray(array[rows])[-rows.start % step :: step, ::step] for rows in row_blocks(array)]
    return np.concatenate(parts)
