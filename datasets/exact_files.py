"""Read the very bytes that were hashed: a file may change between the two, and change back."""

import hashlib
import stat
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from semidense.datasets.errors import DatasetError, MissingFileError


def file_digest(path: Path) -> str:
    """Return the sha256 of a file's bytes, in hex.

    Raises:
        MissingFileError: If it cannot be read, or is not a plain file: a pipe would keep the reader waiting.
    """
    return hashlib.sha256(_read(path)).hexdigest()


@contextmanager
def exact_files(files: Mapping[str, Path], digests: Mapping[str, str]) -> Iterator[Mapping[str, Path]]:
    """Give files to read whose bytes have the digests: copies, which nobody else knows of, of the checked bytes.

    Args:
        files: Role to path.
        digests: Role to sha256 in hex. A file whose role has none is given as it is.

    Raises:
        MissingFileError: If a file cannot be read.
        DatasetError: If a file's bytes have another digest; and what is wrong with a copy is told of its file.
    """
    checked = {role: path for role, path in files.items() if role in digests}
    if not checked:
        yield files
        return
    with tempfile.TemporaryDirectory(prefix="semidense-") as folder:
        copies = {role: _copied(path, digests[role], Path(folder, role)) for role, path in checked.items()}
        try:
            yield {**files, **copies}
        except DatasetError as error:
            message = str(error)
            for role, copy in copies.items():
                message = message.replace(str(copy), str(files[role]))
            raise type(error)(message) from error


def _copied(path: Path, digest: str, folder: Path) -> Path:
    data = _read(path)
    if hashlib.sha256(data).hexdigest() != digest:
        raise DatasetError(f"{path}: it was changed since the run was planned; leave it as it is and run again")
    folder.mkdir()
    copy = folder / path.name
    copy.write_bytes(data)
    return copy


def _read(path: Path) -> bytes:
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise MissingFileError(f"{path}: cannot be read (it is not a plain file)")
        return path.read_bytes()
    except MissingFileError:
        raise
    except OSError as error:
        raise MissingFileError(f"{path}: cannot be read ({error.strerror})") from error
