"""Open what a user named, if it is a file that can be read more than once."""

import codecs
import stat
from pathlib import Path
from typing import BinaryIO

from semidense.datasets.errors import DatasetError, MissingFileError

_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def user_path(text: str) -> Path:
    """Return a path as a user means it: a leading ``~`` is a home folder, unless a file has that very name."""
    path = Path(text)
    try:
        return path if path.exists() else path.expanduser()
    except RuntimeError:  # there is no such user
        return path


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


def read_text(path: Path, largest: int, error: type[DatasetError], kind: str) -> str:
    """Read a small text file whole: UTF-8, or UTF-16 as Windows' programs write it; a byte order mark is dropped.

    Raises what `read_bytes` raises, and an error of the same class for a file that is no such text.
    """
    content = read_bytes(path, largest, error, kind)
    try:
        return content.decode("utf-16" if content.startswith(_UTF16) else "utf-8-sig")
    except UnicodeDecodeError as fault:
        raise error(f"{path}: not plain text; the file is no {kind}, or must be saved as UTF-8") from fault
