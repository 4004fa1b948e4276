"""Check that every byte of an entry is as it was published. Checking changes nothing."""

import errno
import os
import stat
import time
from dataclasses import dataclass
from pathlib import Path

from semidense.cache.document import Documents
from semidense.cache.entries.backend import Policy
from semidense.cache.entries.entry import MANIFEST, Entry, File, Manifest
from semidense.cache.errors import DamagedEntry, EntryNotFound
from semidense.cache.files import hash_file, reading, shared_out, walk
from semidense.cache.layout import Layout

SETTLED = 0.1
"""Seconds after which a file's times tell every later change; they advance in steps of up to 10 ms."""

_Print = tuple[int, int, int, int, int]
_hashed: dict[str, tuple[_Print, str]] = {}
"""Hashes known in this process: path -> (fingerprint at the time, sha256)."""


@dataclass(frozen=True)
class Finding:
    """What a look at an entry found: record and manifest, both sound."""

    entry: Entry
    manifest: Manifest


def read_record(layout: Layout, key: str) -> Entry:
    """Return the entry that the record of ``key`` tells.

    Raises:
        EntryNotFound: if there is no record.
        DamagedEntry: if the record is not what was written.
        CacheUnavailable: if the file system refuses.
    """
    path = layout.record(key)
    with reading(path):
        try:
            data = read_plain(path)
        except FileNotFoundError:
            raise EntryNotFound(f"no entry has the key {key} in {layout.root}") from None
    return RECORDS.read(data, key)


RECORDS = Documents(lambda data, key: Entry.from_bytes(key, data))
MANIFESTS = Documents(Manifest.from_bytes)
"""What this process read or wrote: a run needs the same documents several times."""


def read_plain(path: str | Path) -> bytes:
    """Return a file's bytes; a link in its place is damage, wherever it leads."""
    if not stat.S_ISREG(os.lstat(path).st_mode):
        raise DamagedEntry(f"{path} is not a plain file")
    try:
        with open(path, "rb", buffering=0) as file:  # noqa: PTH123 - thousands are read: a buffer takes time
            return file.read()
    except OSError as error:
        if error.errno == errno.EIO:
            raise DamagedEntry(f"{path} cannot be read from the disk") from error
        raise


def inspect(layout: Layout, key: str, policy: Policy, remember: bool = True) -> Finding:
    """Compare an entry with its record and manifest, as far as the policy goes.

    Args:
        layout: of the cache.
        key: of the entry.
        policy: how much to read.
        remember: whether a hash worked out earlier in this process counts for a file whose
            size, times and inode are still the same.

    Raises:
        EntryNotFound: if there is no record.
        DamagedEntry: naming the first thing that is wrong.
        CacheUnavailable: if the file system refuses.
    """
    return inspect_data(layout, read_record(layout, key), policy, remember)


def inspect_data(layout: Layout, entry: Entry, policy: Policy, remember: bool = True) -> Finding:
    """Compare an entry's data with what its record, given here, says of them; see ``inspect``."""
    folder = layout.entry(entry.key)
    with reading(folder):
        try:
            manifest = _read_manifest(folder, entry)
            _compare_files(folder, manifest, policy, remember)
        except (FileNotFoundError, NotADirectoryError) as error:
            raise DamagedEntry(f"the entry {entry.key} is damaged: {error.filename} is missing") from None
        except DamagedEntry as error:
            raise DamagedEntry(f"the entry {entry.key} is damaged: {error}") from None
    return Finding(entry, manifest)


def _read_manifest(folder: Path, entry: Entry) -> Manifest:
    """Return the manifest if it is the one that the record tells."""
    if not stat.S_ISDIR(folder.lstat().st_mode):
        raise DamagedEntry(f"{folder} is not a folder")
    manifest = MANIFESTS.read(read_plain(folder / MANIFEST))
    if (manifest.digest, manifest.size) != (entry.digest, entry.size):
        raise DamagedEntry(f"its manifest has digest {manifest.digest}, its record {entry.digest}")
    return manifest


def _compare_files(folder: Path, manifest: Manifest, policy: Policy, remember: bool) -> None:
    """Compare what is in the folder with the manifest: names, kinds, sizes, and the bytes if asked."""
    looked, there, folders = time.time(), dict(walk(folder)), manifest.folders
    expected = {MANIFEST, *folders, *(file.path for file in manifest.files)}
    if differing := sorted(there.keys() ^ expected):
        raise DamagedEntry(f"{differing[0]} is {'missing' if differing[0] in expected else 'not in its manifest'}")
    for path in folders:
        if not there[path].is_dir(follow_symlinks=False):
            raise DamagedEntry(f"{path} is not a folder")
    for file in manifest.files:
        _compare_size(file, there[file.path])
    if policy == "full":
        _compare_bytes([(file, there[file.path]) for file in manifest.files], looked if remember else None)


def _compare_size(file: File, thing: os.DirEntry[str]) -> None:
    """Refuse a link, a special file, and a file of another size."""
    if not thing.is_file(follow_symlinks=False):
        raise DamagedEntry(f"{file.path} is a link, or no file at all")
    if (size := thing.stat(follow_symlinks=False).st_size) != file.size:
        raise DamagedEntry(f"{file.path} has {size} bytes, its manifest says {file.size}")


def _compare_bytes(files: "list[tuple[File, os.DirEntry[str]]]", looked: float | None) -> None:
    """Compare each file's hash with the manifest.

    Args:
        files: of the manifest, and what is in their place.
        looked: no later than the times of the files were read; None: no hash is known or kept.
    """

    def differs(each: "tuple[File, os.DirEntry[str]]") -> bool:
        return _hash(each[1], looked) != each[0].sha256

    unknown = [(file, thing) for file, thing in files if looked is None or _known(thing) != file.sha256]
    wrongs = shared_out(differs, unknown, sum(file.size for file, _ in unknown))
    for (file, _), wrong in zip(unknown, wrongs, strict=True):
        if wrong:
            raise DamagedEntry(f"the bytes of {file.path} are not those that were written")


def forget() -> None:
    """Forget what this process knows of files: every byte is read, and every document parsed, again."""
    _hashed.clear()
    RECORDS.forget()
    MANIFESTS.forget()


def _hash(thing: "os.DirEntry[str]", looked: float | None) -> str | None:
    """Return a file's sha256, and keep it if a later change of the file is sure to show; None if the disk fails."""
    try:
        sha256 = hash_file(thing.path)
    except OSError as error:
        if error.errno == errno.EIO:
            return None
        raise
    before = _fingerprint(thing.stat(follow_symlinks=False))
    settled = looked is not None and looked - max(before[1], before[2]) / 1e9 > SETTLED
    if settled and _fingerprint(os.lstat(thing.path)) == before:
        _hashed[thing.path] = (before, sha256)
    return sha256


def _known(thing: "os.DirEntry[str]") -> str | None:
    """Return the hash that was worked out earlier for this very file, unchanged since."""
    known = _hashed.get(thing.path)
    return known[1] if known and known[0] == _fingerprint(thing.stat(follow_symlinks=False)) else None


def _fingerprint(status: os.stat_result) -> _Print:
    """Return what changes with a file: size, both times, inode and device."""
    return status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino, status.st_dev
