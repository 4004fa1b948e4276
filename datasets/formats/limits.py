"""Bound what a file may claim before any memory is given to it."""

from pathlib import Path

from semidense.datasets.errors import DatasetError

MAX_PIXELS = 64 * 1024 * 1024
"""The most pixels an image or a disparity map may have: ten times a full-size Middlebury image."""


def check_pixels(path: Path, rows: int, columns: int, error: type[DatasetError]) -> None:
    """Refuse an empty size, or one above `MAX_PIXELS`.

    Raises:
        DatasetError: Of the class given, with the arithmetic in its message.
    """
    if rows < 1 or columns < 1:
        raise error(f"{path}: {rows} x {columns} pixels; both sides must be at least 1")
    if rows * columns > MAX_PIXELS:
        raise error(
            f"{path}: {rows} x {columns} = {rows * columns:,} pixels, above the limit of {MAX_PIXELS:,}; "
            "scale the image down"
        )
