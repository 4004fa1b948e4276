"""Unpack an archive into a folder: all of it, or nothing."""

import gzip
import lzma
import os
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from semidense.datasets.errors import ArchiveError
from semidense.datasets.formats.archives.kinds import kind_of
from semidense.datasets.formats.archives.plain import check_members

_DAMAGE = (
    zipfile.BadZipFile,
    tarfile.TarError,
    gzip.BadGzipFile,
    zlib.error,
    lzma.LZMAError,
    EOFError,
    NotImplementedError,
    ValueError,
    KeyError,
)
"""What the readers of archives raise for a damaged one, or one packed in a way that they do not know."""


def unpack(archive: Path, folder: Path) -> list[Path]:
    """Unpack a zip, tar or 7z; return its files, where they are now.

    All members are checked before the first is unpacked, see `plain.check_members`. They are unpacked beside the
    folder and then moved: an archive that turns out to be damaged leaves nothing. An existing file of the same name
    is replaced, so that the archives of images and of ground truth may share their folders.

    Args:
        archive: its name tells its kind.
        folder: made if it is missing.

    Raises:
        ArchiveError: If the archive is of no known kind or damaged, or holds what is not let through; or if a link
            that is already in the folder leads out of it.
        OSError: If the folder cannot be written.
    """
    kind = kind_of(archive.name)
    if kind is None:
        raise ArchiveError(f"{archive}: no zip, tar or 7z by its name")
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".unpacking-", dir=folder) as draft:
        with _whole(archive):
            check_members(archive, kind.members(archive), archive.stat().st_size)
            kind.extract(archive, Path(draft))
        return _move_all(archive, Path(draft), folder)


@contextmanager
def _whole(archive: Path) -> Iterator[None]:
    """Turn what a reader says of a damaged archive into one line."""
    try:
        yield
    except ArchiveError:
        raise
    except _DAMAGE as error:
        raise ArchiveError(f"{archive}: damaged, or packed in an unknown way ({error}); fetch it again") from error


def _move_all(archive: Path, draft: Path, folder: Path) -> list[Path]:
    files = sorted(path for path in draft.rglob("*") if not path.is_dir() or path.is_symlink())
    targets = [folder / path.relative_to(draft) for path in files]
    for target in targets:
        _check_place(archive, folder, target)
    for path, target in zip(files, targets, strict=True):
        target.parent.mkdir(parents=True, exist_ok=True)
        path.replace(target)
    return targets


def _check_place(archive: Path, folder: Path, target: Path) -> None:
    if not Path(os.path.realpath(target.parent)).is_relative_to(folder.resolve()) or target.is_dir():
        raise ArchiveError(f"{archive}: {target} is a folder or leads out of {folder}; move it away first")
