"""Write files completely or not at all, and say in one line why one cannot be written."""

import csv
import io
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semidense.datasets.formats.atomic import atomic_write
from semidense.datasets.formats.png16 import PNG_LEVEL
from semidense.pipeline.plan.errors import UsageError

if TYPE_CHECKING:  # an export of maps does without matplotlib's figures, which take a second to load
    from matplotlib.figure import Figure


_FORMULA = ("=", "+", "-", "@")
"""What makes a cell a formula to a spreadsheet."""


@contextmanager
def explaining(path: Path) -> Iterator[None]:
    """Turn the file system's refusal to write ``path`` into one line for the user.

    Raises:
        UsageError: with the path and the system's reason.
    """
    try:
        yield
    except OSError as error:
        raise UsageError(f"{path}: cannot be written ({error.strerror or error}); name another place") from error


def require_writable(folder: Path) -> None:
    """Refuse a folder that cannot be written, without making it: what is to be written may take long.

    Raises:
        UsageError: if it, or the nearest folder above it that there is, is a file or closed to this user.
    """
    place = next(each for each in (folder, *folder.absolute().parents) if each.exists())
    if not place.is_dir():
        raise UsageError(f"{folder}: cannot be written ({place} is a file); name another place")
    if not os.access(place, os.W_OK | os.X_OK):
        raise UsageError(f"{folder}: cannot be written (no permission in {place}); name another place")


def table_text(rows: Iterable[Mapping[str, Any]], columns: Sequence[str]) -> str:
    """Return rows as CSV, other keys left out. A text that a spreadsheet would run as a formula gets a ' before it."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _plain(value) for name, value in row.items()} for row in rows)
    return text.getvalue()


def _plain(value: object) -> object:
    if not isinstance(value, str):
        return value
    text = value.replace("\r", " ")  # which would end the row
    return f"'{text}" if text.lstrip().startswith(_FORMULA) else text


def save_png(figure: "Figure", path: Path) -> None:
    """Write a figure as PNG; an existing file is replaced, a reader sees the old one or the new one.

    Raises:
        UsageError: if the file cannot be written.
    """
    with explaining(path), atomic_write(path) as file:
        figure.savefig(file, format="png")


def write_rgb(rgb: NDArray[np.uint8] | NDArray[np.uint16], path: Path) -> None:
    """Write colours (y, x, 3) of 8 bits, or gray (y, x) of 8 or 16 bits, as a PNG; an existing file is replaced.

    Raises:
        UsageError: if the file cannot be written.
    """
    with explaining(path), atomic_write(path) as file:
        Image.fromarray(rgb).save(file, "PNG", compress_level=PNG_LEVEL)


def writable_folder(folder: Path) -> None:
    """Make a folder if it is missing.

    Raises:
        UsageError: if it is a file, or cannot be made or written to.
    """
    with explaining(folder):
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):  # permissions alone do not tell: the file system may be read-only
            pass
