"""Files that survive a crash, a kill and a full disk.

Much here is done for each of thousands of small files, where building paths would take longer than what is done with
them: so it calls ``os``, and takes a path as text too.
"""

import errno
import hashlib
import os
import secrets
import shutil
import stat
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import TypeVar

from semidense.cache.errors import CacheError, CacheUnavailable

T = TypeVar("T")
R = TypeVar("R")
THREADS = 4
"""Threads that read, hash and sync: enough to hide the disk's latency."""
THREADS_PAY = 1 << 20
"""Bytes from which on starting threads takes less time than they save."""
_BLOCK = 1 << 18
"""Bytes of a file that are read and hashed at a time."""

_ADVICE = {
    errno.ENOSPC: "free some space, or choose another cache folder",
    errno.EDQUOT: "free some space, or choose another cache folder",
    errno.EFBIG: "raise the limit on the size of files, or choose another cache folder",
    errno.EROFS: "choose a cache folder that can be written",
    errno.ENOTDIR: "something there is a file: choose another cache folder",
    errno.EEXIST: "something there is a file: choose another cache folder",
    errno.ELOOP: "it is a link, which the cache does not follow: remove it, or choose another cache folder",
    errno.EMFILE: "raise the limit on open files (ulimit -n), or use fewer workers",
    errno.ENFILE: "this machine has too many files open: close some programs",
    errno.ENOMEM: "free some memory, or use fewer workers",
    errno.EACCES: "check its permissions, or choose another cache folder",
    errno.EPERM: "check its permissions, or choose another cache folder",
}


def writing(path: Path) -> AbstractContextManager[None]:
    """Turn a failure of the file system under ``path`` into ``CacheUnavailable``, one line with advice."""
    return _explaining(path, "write to")


def reading(path: Path) -> AbstractContextManager[None]:
    """Turn a failure of the file system under ``path`` into ``CacheUnavailable``, one line with advice."""
    return _explaining(path, "read")


@contextmanager
def _explaining(path: Path, action: str) -> Iterator[None]:
    try:
        yield
    except CacheError:
        raise
    except OSError as error:
        advice = _ADVICE.get(error.errno or 0, "choose another cache folder")
        raise CacheUnavailable(f"cannot {action} the cache at {path}: {error.strerror or error}; {advice}") from error


def in_threads(function: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """Return ``function`` of each item, in order, worked out by a few threads.

    All threads have ended when this returns or raises, so that nothing is written afterwards.
    """
    items = list(items)
    if len(items) < 2:  # starting a thread would take longer
        return [function(item) for item in items]
    found: dict[int, R] = {}
    waiting = deque(enumerate(items))

    def take() -> tuple[int, T] | None:
        try:
            return waiting.popleft()
        except IndexError:  # to look first would be no use: another thread may take the last one in between
            return None

    def work() -> None:  # a task a thread: one an item would take longer than looking at a small entry
        try:
            while each := take():
                found[each[0]] = function(each[1])
        finally:
            waiting.clear()  # the other threads end too: nothing is left, or something went wrong

    with ThreadPoolExecutor(THREADS) as pool:
        try:
            threads = [pool.submit(work) for _ in range(min(THREADS, len(items)) - 1)]
            work()
            for thread in threads:
                thread.result()
        finally:
            waiting.clear()
    return [found[number] for number in range(len(items))]


def shared_out(function: Callable[[T], R], items: Iterable[T], size: int) -> list[R]:
    """Return ``function`` of each item, in order, worked out by a few threads if the items have many bytes together."""
    return in_threads(function, items) if size >= THREADS_PAY else [function(item) for item in items]


def is_folder(path: Path) -> bool:
    """Return whether the path is a folder; a link to a folder does not count."""
    return os.path.isdir(path) and not os.path.islink(path)


def require_no_link(path: Path) -> None:
    """Refuse a link.

    Raises:
        OSError: if ``path`` is one.
    """
    if path.is_symlink():
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))


def make_folder(path: Path) -> None:
    """Make a folder and its parents; each new name is on disk before this returns.

    Raises:
        OSError: if that is not possible, or a link stands in the folder's place.
    """
    if is_folder(path):
        return
    require_no_link(path)
    missing = [*takewhile(lambda folder: not folder.is_dir(), (path, *path.parents))]
    for folder in reversed(missing):
        folder.mkdir(exist_ok=True)
        sync(folder.parent)


def add_folder(path: Path) -> None:
    """Make a folder inside one that is there, unless it is there; its name need not be on disk yet.

    Raises:
        OSError: if that is not possible, or a link stands in the folder's place.
    """
    if not is_folder(path):
        require_no_link(path)
        path.mkdir(exist_ok=True)


def make_new_folders(paths: Iterable[str]) -> None:
    """Make folders, outer ones first; their names need not be on disk yet.

    Raises:
        OSError: if one is there, or its parent is not.
    """
    for path in paths:
        os.mkdir(path)


def sync(path: str | Path) -> None:
    """Have the file, or the names in the folder, on disk before this returns."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_new(path: str | Path, data: bytes) -> None:
    """Write a new read-only file; it need not be on disk yet."""
    with open(path, "xb", buffering=0, opener=_open_read_only) as file:
        left = memoryview(data)
        while left:
            left = left[file.write(left) :]


def _open_read_only(path: str, flags: int) -> int:
    """Open a new file that nobody but its writer can write to."""
    return os.open(path, flags, 0o444)


def write_whole(path: str | Path, data: bytes) -> None:
    """Write a file, and its folders, so that whoever sees it sees all of it; it need not be on disk yet."""
    temporary = f"{path}.{secrets.token_hex(8)}.partial"
    try:
        try:
            _write(temporary, data)
        except FileNotFoundError:
            os.makedirs(os.path.dirname(path), exist_ok=True)
            _write(temporary, data)
        os.replace(temporary, path)
    except BaseException:
        with suppress(FileNotFoundError):
            os.unlink(temporary)
        raise


def _write(path: str, data: bytes) -> None:
    with open(path, "wb") as file:
        file.write(data)


def hash_file(path: str | Path) -> str:
    """Return the sha256 of a file's bytes, in hexadecimal."""
    sha256 = hashlib.sha256()
    with open(path, "rb", buffering=0) as file:  # a buffer would cost more than hashing a small file
        while block := file.read(_BLOCK):
            sha256.update(block)
    return sha256.hexdigest()


def make_read_only(path: str | Path) -> int:
    """Take away everybody's right to write; return the size."""
    status = os.stat(path)
    os.chmod(path, stat.S_IMODE(status.st_mode) & ~0o222)
    return status.st_size


@dataclass(frozen=True)
class StateFile:
    """A file that is written as a whole, again and again."""

    path: Path

    def save(self, data: bytes) -> None:
        """Replace the content; a reader sees the old one or the new one, never a part.

        Raises:
            CacheUnavailable: if the file system refuses.
        """
        temporary = self.path.with_name(f".{self.path.name}.{secrets.token_hex(4)}")
        with writing(self.path):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            try:
                with temporary.open("xb") as file:
                    file.write(data)
                    file.flush()
                    os.fsync(file.fileno())
                temporary.replace(self.path)
            finally:
                remove(temporary)

    def load(self) -> bytes | None:
        """Return the content; None if there is no such file.

        Raises:
            CacheUnavailable: if the file system refuses.
        """
        with reading(self.path):
            return self.path.read_bytes() if self.path.is_file() else None

    def remove(self) -> None:
        """Delete the file, and what a killed writer left beside it.

        Raises:
            CacheUnavailable: if the file system refuses.
        """
        with writing(self.path):
            for file in (self.path, *self.path.parent.glob(f".{self.path.name}.*")):
                file.unlink(missing_ok=True)


def walk(folder: Path) -> Iterator[tuple[str, os.DirEntry[str]]]:
    """Yield all that is below ``folder``, each with its path relative to it; links are not followed."""
    root, waiting = f"{folder}/", [""]
    for prefix in waiting:
        with os.scandir(root + prefix) as things:  # many small files: building paths would take most of the time
            for thing in things:
                yield (path := prefix + thing.name), thing
                if thing.is_dir(follow_symlinks=False):
                    waiting.append(path + "/")


def move_folder(source: Path, target: Path) -> None:
    """Rename a folder to a new name; it is made writable, since its ``..`` changes."""
    source.chmod(stat.S_IMODE(source.lstat().st_mode) | 0o700)
    source.rename(target)


def remove(path: Path) -> None:
    """Delete a file or folder, read-only or not, as far as that is possible."""
    if path.is_symlink() or not path.is_dir():
        with suppress(OSError):
            path.unlink(missing_ok=True)
        return
    with suppress(OSError):
        _unlock_folders(path)
    shutil.rmtree(path, ignore_errors=True)


def _unlock_folders(path: Path) -> None:
    """Make a folder and those below it writable, outer ones first."""
    path.chmod(0o700)
    with os.scandir(path) as things:
        inner = [Path(thing.path) for thing in things if thing.is_dir(follow_symlinks=False)]
    for each in inner:
        _unlock_folders(each)
