"""What running processes use: each keeps a list of keys, and nobody cleans away what is on a list.

A lease is a file that its process holds locked, so it ends with the process, however that ends. Adding to a
lease and cleaning exclude each other: an entry that is there after it was added stays there. Drafts carry the
name of their run's lease: they are alive as long as it is held, whoever writes them.
"""

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from semidense.cache.errors import CacheUnavailable
from semidense.cache.files import remove, writing
from semidense.cache.layout import Layout, is_key, require_key
from semidense.cache.processes.locks import Lock, held, is_held, lock, try_lock

_LINE = re.compile(r"^([0-9a-f]{64})\n", re.ASCII | re.MULTILINE)


@dataclass(frozen=True)
class FolderLease:
    """The list of keys that a process uses; other processes that work for it can add to it.

    Attributes:
        root: the cache's folder.
        path: the list; None in a cache that cannot be written: nothing is cleaned away there either.
    """

    root: Path
    path: Path | None

    @property
    def name(self) -> str | None:
        """The first part of the names of its run's drafts; None in a cache that cannot be written."""
        return self.path.name if self.path else None

    def discard_drafts(self) -> None:
        """Delete all drafts of its run, whichever process began them.

        Raises:
            CacheUnavailable: if the file system refuses.
        """
        layout = Layout(self.root)
        for draft in layout.things(layout.drafts) if self.path else ():
            if layout.lease_of(draft) == self.path:
                remove(draft)

    def add(self, keys: Iterable[str]) -> None:
        """Keep the entries of these keys, those that are yet to come too, and note that they are in use.

        Raises:
            InvalidKey: if one is not a key.
            CacheUnavailable: if the file system refuses.
        """
        lines = "".join(f"{require_key(key)}\n" for key in keys)
        layout = Layout(self.root)
        if not lines or self.path is None:
            return
        with cleaning(layout), writing(self.path):
            handle = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
            try:
                os.write(handle, lines.encode("ascii"))
            finally:
                os.close(handle)
        for key in lines.split():
            with suppress(OSError):
                os.utime(layout.record(key))  # a record's time says when its entry was last used

    def is_seen(self) -> bool:
        """Return whether this process sees the lease: whether it works on the same folder as the run."""
        return self.path is None or self.path.is_file()


@contextmanager
def leased(layout: Layout) -> Iterator[FolderLease]:
    """Open a lease and end it with the block."""
    try:
        mine = take_lease(layout)
    except CacheUnavailable:
        yield FolderLease(layout.root, None)
        return
    try:
        yield FolderLease(layout.root, mine.path)
    finally:
        mine.release()


def take_lease(layout: Layout) -> Lock:
    """Return the lock of a new lease.

    Raises:
        CacheUnavailable: if the cache cannot be written.
    """
    layout.create()
    with cleaning(layout):
        return lock(layout.new_lease())


@contextmanager
def cleaning(layout: Layout) -> Iterator[None]:
    """Hold what excludes adding to leases and cleaning."""
    with held(layout.locks / "leases"):
        yield


def in_use(layout: Layout) -> frozenset[str]:
    """Return the keys on the lists of running processes."""
    found: set[str] = set()
    for path in filter(is_held, layout.things(layout.leases)):
        with suppress(FileNotFoundError):
            found.update(_LINE.findall(path.read_text(encoding="ascii", errors="replace")))
    return frozenset(found)


def is_abandoned(layout: Layout, draft: Path) -> bool:
    """Return whether the run that a draft belongs to is gone: nobody holds its lease."""
    return not is_held(layout.lease_of(draft))


def sweep_locks(layout: Layout) -> None:
    """Delete the files of locks and leases whose processes are gone.

    Raises:
        CacheUnavailable: if the file system refuses.
    """
    for path in (*layout.things(layout.locks), *layout.things(layout.leases)):
        if not is_held(path):
            remove_stale(layout, path)


def remove_stale(layout: Layout, path: Path) -> bool:
    """Delete a lock's file if nobody holds it, while holding it: nobody then takes a lock that is deleted."""
    if path.parent == layout.leases:
        with cleaning(layout):  # a lease that is just being opened is not locked yet
            return _remove_unheld(path)
    return _remove_unheld(path)


def _remove_unheld(path: Path) -> bool:
    if not path.is_file() or path.is_symlink():
        remove(path)  # a pipe or a link in a lock's place
        return True
    taken = try_lock(path)
    if taken:
        taken.release()
    return taken is not None


def sweep_checkpoints(layout: Layout) -> None:
    """Delete the checkpoints of products that are there, unless somebody makes one again.

    Raises:
        CacheUnavailable: if the file system refuses.
    """
    for key in filter(is_key, (path.name for path in layout.things(layout.checkpoints))):
        if layout.record(key).exists() and not is_held(layout.lock("making", key)):
            remove(layout.checkpoint(key))
