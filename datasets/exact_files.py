"""Read the very bytes that were hashed: a file may change between the two, and change back."""

import hashlib
import json
import stat
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from semidense.datasets.errors import DatasetError, MissingFileError

_OF_ZARR = ("zarr.json", ".zarray", ".zgroup")
"""A folder with one of these files is a Zarr array or group, which is read as one."""


def file_digest(path: Path) -> str:
    """Return the sha256 of a file's bytes, in hex; of a Zarr folder, that of the names and digests of its files.

    Raises:
        MissingFileError: If it cannot be read, or is not a plain file: a pipe would keep the reader waiting.
    """
    return _digest(_content(path))


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
    content = _content(path)
    if _digest(content) != digest:
        raise DatasetError(f"{path}: it was changed since the run was planned; leave it as it is and run again")
    copy = folder / path.name
    for name, data in content.items():
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).write_bytes(data)
    return copy


def _content(path: Path) -> dict[str, bytes]:
    """Return the bytes of a file, named "", or of each file in a Zarr folder, by its path in there."""
    if not any((path / name).is_file() for name in _OF_ZARR):
        return {"": _read(path)}
    files = sorted(each.relative_to(path).as_posix() for each in path.rglob("*") if not each.is_dir())
    return {name: _read(path / name) for name in files}


def _digest(content: Mapping[str, bytes]) -> str:
    digests = {name: hashlib.sha256(data).hexdigest() for name, data in content.items()}
    return digests[""] if "" in digests else hashlib.sha256(json.dumps(digests).encode()).hexdigest()


def _read(path: Path) -> bytes:
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise MissingFileError(f"{path}: cannot be read (it is not a plain file)")
        return path.read_bytes()
    except MissingFileError:
        raise
    except OSError as error:
        raise MissingFileError(f"{path}: cannot be read ({error.strerror})") from error
