"""Entries as one file: a plain tar, so that a colleague's results can be reused without trusting the way they came.

::

    KEY/record.json
    KEY/manifest.json
    KEY/data.zarr/...

What comes in is checked like what a writer publishes: only plain files inside their entry, each with the size and
sha256 of its manifest, arrays of the form this package writes and of bounded size, and a record whose key is that of
its recipe. It shows that nothing was changed on the way, not that the sender computed what the recipe says: take
archives from people you trust, and make a product again to compare where you are in doubt.
"""

import hashlib
import io
import os
import re
import secrets
import tarfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import BinaryIO, Literal

from semidense.cache.entries import publish
from semidense.cache.entries.check import inspect
from semidense.cache.entries.entry import MANIFEST, Entry, Manifest
from semidense.cache.entries.folder import FolderBackend
from semidense.cache.errors import CacheError, CacheUnavailable, DamagedArchive, DamagedEntry, NonDeterministicStage
from semidense.cache.files import make_folder, remove, sync, writing
from semidense.cache.store import Store
from semidense.cache.upkeep.imported_arrays import check_arrays

LARGEST = 1 << 40
"""Bytes of one entry, stored or decoded; more is refused before anything is written."""
LARGEST_DOCUMENT = 1 << 26
"""Bytes of a record or manifest."""
RECORD = "record.json"
_MEMBER = re.compile(
    r"([0-9a-f]{64})/((?:record|manifest)\.json|data\.zarr(?:/[A-Za-z0-9_][A-Za-z0-9._-]*)+)", re.ASCII
)
_COPIED = 1 << 20

Outcome = Literal["added", "there already", "differs: yours is kept"]


@dataclass(frozen=True)
class Imported:
    """What became of an entry of an archive."""

    entry: Entry
    outcome: Outcome


def export_entries(store: Store, keys: Iterable[str], target: Path) -> list[Entry]:
    """Write entries, each checked to the byte, into a new archive; return them.

    Raises:
        EntryNotFound, DamagedEntry: if one is not there, or not what was published.
        CacheUnavailable: if the file system refuses; ``target`` is then as it was before.
    """
    with _put_in_place(target) as file, tarfile.open(fileobj=file, mode="w", format=tarfile.PAX_FORMAT) as archive:
        return [_add_entry(archive, store, key) for key in sorted(set(keys))]


@contextmanager
def _put_in_place(target: Path) -> Iterator[BinaryIO]:
    """Write a file beside its place, and rename it when it is whole and on disk."""
    temporary = target.with_name(f".{target.name}.{os.getpid()}.{secrets.token_hex(4)}")
    try:
        with temporary.open("xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(target)
        sync(target.parent)
    except CacheError:
        raise
    except OSError as error:
        raise CacheUnavailable(f"cannot write the archive {target}: {error.strerror or error}") from error
    finally:
        remove(temporary)


def _add_entry(archive: tarfile.TarFile, store: Store, key: str) -> Entry:
    found = inspect(store.layout, key, "full", remember=False)
    folder = store.layout.entry(key)
    _add(archive, f"{key}/{RECORD}", found.entry.to_bytes())
    _add(archive, f"{key}/{MANIFEST}", found.manifest.to_bytes())
    for file in found.manifest.files:
        data = (folder / file.path).read_bytes()
        if hashlib.sha256(data).hexdigest() != file.sha256:
            raise DamagedEntry(f"the entry {key} is damaged: {file.path} changed while it was copied")
        _add(archive, f"{key}/{file.path}", data)
    return found.entry


def _add(archive: tarfile.TarFile, name: str, data: bytes) -> None:
    member = tarfile.TarInfo(name)
    member.size, member.mode = len(data), 0o444
    archive.addfile(member, io.BytesIO(data))


def import_entries(store: Store, source: Path) -> Iterator[Imported]:
    """Take over the entries of an archive one by one; each is published whole, or not at all.

    Yields:
        Each entry, once it is there, and whether it was before.

    Raises:
        DamagedArchive: naming the archive, the member and what is wrong with it; entries before it are kept.
        CacheUnavailable: if the file system refuses.
    """
    try:
        with source.open("rb") as file, tarfile.open(fileobj=file, mode="r:", errorlevel=1) as archive:
            yield from _entries(store, archive)
    except (tarfile.TarError, EOFError, OverflowError) as error:
        raise DamagedArchive(f"{source}: no readable archive of cache entries ({_one_line(error)})") from None
    except _Refused as error:
        raise DamagedArchive(f"{source}: {_one_line(error)}; nothing of this entry was taken over") from None
    except OSError as error:
        if isinstance(error, CacheError):
            raise
        raise DamagedArchive(f"{source}: cannot be read ({error.strerror or error})") from error


class _Refused(Exception):  # noqa: N818
    """Something in the archive is not as ``export_entries`` writes it."""


def _one_line(error: Exception) -> str:
    text = "".join(letter if letter.isprintable() else " " for letter in str(error)[:200])
    return text or type(error).__name__


def _entries(store: Store, archive: tarfile.TarFile) -> Iterator[Imported]:
    """Read the archive's members in order, entry by entry: record, manifest, files as the manifest lists them."""
    seen: set[str] = set()
    while (member := archive.next()) is not None:
        key, path = _parse(member)
        if path != RECORD or key in seen:
            raise _Refused(f"{member.name} is not where it belongs: an entry starts with its record, and comes once")
        seen.add(key)
        entry, manifest = _documents(archive, member, key)
        yield _take_over(store, archive, entry, manifest)


def _parse(member: tarfile.TarInfo) -> tuple[str, str]:
    """Return a member's key and path; refuse all but plain files inside an entry."""
    match = _MEMBER.fullmatch(member.name)
    if match is None or ".." in PurePosixPath(member.name).parts:
        raise _Refused(f"{member.name!r} is not the name of a file of an entry")
    if not member.isreg() or member.issparse():
        raise _Refused(f"{member.name} is a link, a folder or another special thing, not a plain file")
    return match[1], match[2]


def _documents(archive: tarfile.TarFile, member: tarfile.TarInfo, key: str) -> tuple[Entry, Manifest]:
    try:
        entry = Entry.from_bytes(key, _read(archive, member))
        manifest = Manifest.from_bytes(_read(archive, _next(archive, key, MANIFEST)))
    except DamagedEntry as error:
        raise _Refused(str(error)) from None
    if (manifest.digest, manifest.size) != (entry.digest, entry.size):
        raise _Refused(f"the manifest of {key} is not the one that its record tells")
    if entry.size > LARGEST:
        raise _Refused(f"{key} has {entry.size:,} bytes, at most {LARGEST:,} are taken")
    return entry, manifest


def _next(archive: tarfile.TarFile, key: str, path: str) -> tarfile.TarInfo:
    """Return the next member, which must be this file of this entry."""
    member = archive.next()
    if member is None or _parse(member) != (key, path):
        raise _Refused(f"{key}/{path} is missing" + (f", {member.name!r} is in its place" if member else ""))
    return member


def _read(archive: tarfile.TarFile, member: tarfile.TarInfo) -> bytes:
    if member.size > LARGEST_DOCUMENT:
        raise _Refused(f"{member.name} has {member.size:,} bytes, at most {LARGEST_DOCUMENT:,} are read")
    content = archive.extractfile(member)
    data = content.read() if content else b""
    if len(data) != member.size:
        raise _Refused(f"{member.name} is cut off")
    return data


def _take_over(store: Store, archive: tarfile.TarFile, entry: Entry, manifest: Manifest) -> Imported:
    """Unpack an entry into a draft, check it, and publish it."""
    layout, before = store.layout, store.check(entry.key) is None
    draft = FolderBackend(layout).begin(entry.recipe, entry.label, None, "")
    try:
        with writing(draft.path):
            for file in manifest.files:
                _unpack(archive, _next(archive, entry.key, file.path), draft.path, file.path, file.size, file.sha256)
            _check(draft.path, manifest)
            sealed = publish.seal(draft.path, [file.path for file in manifest.files])
            if sealed != manifest:
                raise _Refused(f"the files of {entry.key} are not those of its manifest")
            (published,) = publish.commit(layout, {draft.path: entry})
    except NonDeterministicStage:
        return Imported(entry, "differs: yours is kept")
    finally:
        draft.discard()
    return Imported(published, "there already" if before else "added")


def _check(folder: Path, manifest: Manifest) -> None:
    try:
        check_arrays(folder, manifest, LARGEST)
    except ValueError as error:
        raise _Refused(str(error)) from None


def _unpack(archive: tarfile.TarFile, member: tarfile.TarInfo, folder: Path, path: str, size: int, sha256: str) -> None:
    """Write one file, of exactly the size and the bytes that the manifest says."""
    if member.size != size:
        raise _Refused(f"{member.name} has {member.size:,} bytes, its manifest says {size:,}")
    make_folder((folder / path).parent)
    content, hashed, copied = archive.extractfile(member), hashlib.sha256(), 0
    with (folder / path).open("xb") as file:
        while content and (part := content.read(_COPIED)):
            hashed.update(part)
            copied += len(part)
            file.write(part)
    if copied != size or hashed.hexdigest() != sha256:
        raise _Refused(f"the bytes of {member.name} are not those that its manifest says")
