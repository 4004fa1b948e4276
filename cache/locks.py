"""Locks between processes and threads that die with their holder.

A lock saves work, it is never what makes a result right: the digests in the records do that.
"""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cache.files import writing


@contextmanager
def held(path: Path) -> Iterator[None]:
    """Hold the lock of this name; wait while another process or thread does. Its file goes with it."""
    handle = _acquire(path)
    try:
        yield
    finally:
        path.unlink(missing_ok=True)  # while it is still held: who waits on this file sees that it is stale
        os.close(handle)


def _acquire(path: Path) -> int:
    """Return an open, locked handle of the file that the path names at this moment."""
    with writing(path):
        while True:
            handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX)
                if _is_same(handle, path):
                    return handle
            except BaseException:
                os.close(handle)
                raise
            os.close(handle)


def _is_same(handle: int, path: Path) -> bool:
    """Return whether the path still names the open file; its last holder may have removed it."""
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False
