"""List and extract zip, tar and 7z; `semidense.datasets.formats.archives.unpack` says what of them is let through."""

import stat
import tarfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from semidense.datasets.errors import ArchiveError
from semidense.datasets.formats.archives.plain import FREE_BYTES, Kind, Member

if TYPE_CHECKING:
    from py7zr import SevenZipFile


@dataclass(frozen=True)
class Archives:
    """How one kind of archive is read.

    Attributes:
        endings: of the names of its files, in lower case.
        members: lists what a file holds.
        extract: puts all that it holds into an empty folder; called only when every member is a plain file or folder.
    """

    endings: tuple[str, ...]
    members: Callable[[Path], Iterator[Member]]
    extract: Callable[[Path, Path], None]


def _zip_members(path: Path) -> Iterator[Member]:
    with zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            if info.flag_bits & 1:
                raise ArchiveError(
                    f"{path}: {info.filename!r} is encrypted; take the archive that its publisher offers"
                )
            # The name as stored: the other one is cut at the first NUL.
            yield Member(info.orig_filename, _zip_kind(info), info.file_size)


def _zip_kind(info: zipfile.ZipInfo) -> Kind:
    mode = stat.S_IFMT(info.external_attr >> 16)
    if info.is_dir() or mode == stat.S_IFDIR:
        return "folder"
    return "file" if mode in (0, stat.S_IFREG) else "link" if mode == stat.S_IFLNK else "device"


def _zip_extract(path: Path, folder: Path) -> None:
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)


def _tar_members(path: Path) -> Iterator[Member]:
    with tarfile.open(path) as archive:
        for info in archive:
            yield Member(info.name, _tar_kind(info), info.size)


def _tar_kind(info: tarfile.TarInfo) -> Kind:
    if info.issym() or info.islnk():
        return "link"
    return "folder" if info.isdir() else "file" if info.isreg() else "device"


def _tar_extract(path: Path, folder: Path) -> None:
    with tarfile.open(path) as archive:
        archive.extractall(folder, filter="data")
        # The checksum of a compressed tar comes last, and is compared only by who reads so far.
        if archive.fileobj and len(archive.fileobj.read(FREE_BYTES + 1)) > FREE_BYTES:
            raise ArchiveError(f"{path}: more than {FREE_BYTES:,} bytes follow its last member; fetch it again")


def _sevenzip_members(path: Path) -> Iterator[Member]:
    with _sevenzip(path) as archive:
        for info in archive.list():
            kind: Kind = "folder" if info.is_directory else "file" if info.is_file else "link"
            yield Member(info.filename, kind, info.uncompressed)


def _sevenzip_extract(path: Path, folder: Path) -> None:
    with _sevenzip(path) as archive:
        archive.extractall(folder)


@contextmanager
def _sevenzip(path: Path) -> Iterator["SevenZipFile"]:
    try:
        import py7zr
    except ImportError as error:
        raise ArchiveError(
            f"{path}: to unpack 7z, install py7zr (pip install 'semidense-stereo[7z]'), or run 7z x yourself"
        ) from error
    try:
        with py7zr.SevenZipFile(path) as archive:
            yield archive
    except (py7zr.exceptions.ArchiveError, py7zr.exceptions.PasswordRequired) as error:
        raise ArchiveError(f"{path}: damaged, or packed in an unknown way ({error}); fetch it again") from error


KINDS = (
    Archives((".zip",), _zip_members, _zip_extract),
    Archives((".tar", ".tar.gz", ".tgz"), _tar_members, _tar_extract),
    Archives((".7z",), _sevenzip_members, _sevenzip_extract),
)
"""The kinds of archive that are unpacked."""


def kind_of(name: str) -> Archives | None:
    """Return the kind of archive that a file's name tells; None for any other file.

    >>> kind_of("https://example.org/scenes.tar.gz") is KINDS[1], kind_of("im2.ppm")
    (True, None)
    """
    return next((kind for kind in KINDS if name.lower().endswith(kind.endings)), None)
