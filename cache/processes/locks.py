"""Locks between processes and threads that die with their holder, and that say who holds them.

A lock saves work, it is never what makes a result right: the digests in the records do that.
"""

import errno
import fcntl
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from semidense.cache.errors import CacheError
from semidense.cache.files import writing
from semidense.cache.owner import describe, owner

_LONGEST = 512
_CAREFULLY = os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
"""A pipe in a lock's place must not make anybody wait, nor a link lead out of the cache."""


@dataclass(frozen=True)
class Lock:
    """A lock that this process holds, until it is released or the process ends, however that ends."""

    path: Path
    handle: int

    def release(self) -> None:
        """Let the next one have it. The file goes first, while it is held: who waits on it sees that it is stale."""
        with suppress(OSError):
            self.path.unlink(missing_ok=True)
        with suppress(OSError):
            os.close(self.handle)


@contextmanager
def held(path: Path) -> Iterator[None]:
    """Hold the lock of this name; wait while another process or thread does.

    Raises:
        CacheUnavailable: if the file system refuses.
    """
    taken = lock(path)
    try:
        yield
    finally:
        taken.release()


def lock(path: Path) -> Lock:
    """Return the lock of this name, after waiting for whoever holds it.

    Raises:
        CacheUnavailable: if the file system refuses.
    """
    with writing(path):
        while (taken := _attempt(path, fcntl.LOCK_EX)) is None:
            continue  # its last holder removed the file that was waited for
    return taken


def try_lock(path: Path) -> Lock | None:
    """Return the lock of this name, None while another process or thread holds it.

    Raises:
        CacheUnavailable: if the file system refuses.
    """
    try:
        with writing(path):
            while (taken := _attempt(path, fcntl.LOCK_EX | fcntl.LOCK_NB)) is None:
                continue
    except _Busy:
        return None
    return taken


def is_held(path: Path) -> bool:
    """Return whether a process or thread holds the lock of this name; its file stays as it is."""
    try:
        handle = os.open(path, os.O_RDONLY | _CAREFULLY)
    except OSError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(handle)
    return False


def holder(path: Path) -> str | None:
    """Return who holds a lock, for people: ``process 123 on host``; None if nobody says so."""
    try:
        handle = os.open(path, os.O_RDONLY | _CAREFULLY)
        with os.fdopen(handle, encoding="ascii", errors="replace") as file:
            return describe(file.readline(_LONGEST).rstrip())
    except OSError:
        return None


class _Busy(CacheError):  # noqa: N818
    """Somebody else holds the lock."""


def _attempt(path: Path, operation: int) -> Lock | None:
    """Lock the file that the path names now; None if it names another one by the time that it is locked."""
    handle = os.open(path, os.O_RDWR | os.O_CREAT | _CAREFULLY, 0o666)
    try:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise OSError(errno.EINVAL, "something there is not a plain file", str(path))
        fcntl.flock(handle, operation)
        if _is_same(handle, path):
            _sign(handle)
            return Lock(path, handle)
    except BlockingIOError:
        os.close(handle)
        raise _Busy from None
    except BaseException:
        os.close(handle)
        raise
    os.close(handle)
    return None


def _is_same(handle: int, path: Path) -> bool:
    """Return whether the path still names the open file; its last holder may have removed it."""
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False


def _sign(handle: int) -> None:
    """Write who holds the lock into its file's first line; a full disk keeps it unsigned."""
    with suppress(OSError):
        os.ftruncate(handle, 0)
        os.pwrite(handle, f"{owner()}\n".encode("ascii"), 0)
