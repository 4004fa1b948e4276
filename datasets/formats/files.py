"""Open what a user named, if it is a file that can be read more than once."""

import stat
from pathlib import Path
from typing import BinaryIO

from semidense.datasets.errors import DatasetError, MissingFileError


def open_file(path: Path) -> BinaryIO:
    """Open a regular file for reading bytes.

    A pipe such as ``<(command)`` is refused before it is opened: opening it may wait for ever, and what was read from
    it once is gone, while a scene's files are read several times.

    Raises:
        MissingFileError: If it is not there, may not be read, or is a folder, a pipe or a device.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            kind = "a folder" if path.is_dir() else "a pipe or a device: save what it gives as a file and name that"
            raise MissingFileError(f"{path}: cannot be read ({kind})")
        return path.open("rb")
    except OSError as error:
        raise as_missing(path, error) from error


def as_missing(path: Path, error: OSError) -> MissingFileError:
    """Return an error of the operating system as one line."""
    if isinstance(error, MissingFileError):
        return error
    return MissingFileError(f"{path}: cannot be read ({error.strerror})")


def read_bytes(path: Path, largest: int, error: type[DatasetError], kind: str) -> bytes:
    """Read a small file whole.

    Args:
        path: The file.
        largest: Most bytes that it may have.
        error: What to raise for a larger one.
        kind: What the file should be, for the message.

    Raises:
        MissingFileError: If it cannot be read.
        DatasetError: Of the class given, if it is larger.
    """
    with open_file(path) as file:
        try:
            content = file.read(largest + 1)
        except OSError as fault:
            raise as_missing(path, fault) from fault
    if len(content) > largest:
        raise error(f"{path}: more than {largest:,} bytes; the file is no {kind}")
    return content
