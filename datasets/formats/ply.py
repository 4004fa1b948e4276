"""Write coloured point clouds as PLY, the Stanford polygon format, binary and little-endian.

Source: http://paulbourke.net/dataformats/ply/
"""

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semidense.datasets.errors import DatasetError
from semidense.datasets.formats.atomic import atomic_write

_VERTEX = np.dtype([*((axis, "<f4") for axis in "xyz"), *((band, "u1") for band in ("red", "green", "blue"))])
_PROPERTIES = (
    *(f"property float {axis}" for axis in "xyz"),
    *(f"property uchar {b}" for b in ("red", "green", "blue")),
)


def write_ply(
    path: str | os.PathLike[str],
    points: NDArray[np.floating],
    colours: NDArray[np.uint8],
    comments: Iterable[str] = (),
) -> None:
    """Write points, atomically.

    Args:
        path: Where to; an existing file is replaced.
        points: (point, 3) float: x, y, z; stored as float32.
        colours: (point, 3) uint8: red, green, blue.
        comments: Lines of ASCII text for the header.

    Raises:
        DatasetError: If the arrays do not fit together.
        OSError: If the file cannot be written.
    """
    path = Path(path)
    if points.ndim != 2 or points.shape[1:] != (3,) or colours.shape != points.shape:
        raise DatasetError(f"{path}: points of {points.shape} and colours of {colours.shape}; give (points, 3) twice")
    vertices = np.empty(len(points), _VERTEX)
    for index, name in enumerate(_VERTEX.names or ()):
        vertices[name] = (points if index < 3 else colours)[:, index % 3]
    lines = ["ply", "format binary_little_endian 1.0", *(f"comment {comment}" for comment in comments)]
    lines += [f"element vertex {len(points)}", *_PROPERTIES, "end_header", ""]
    with atomic_write(path) as file:
        file.write("\n".join(lines).encode("ascii", "replace"))
        file.write(vertices.tobytes())
