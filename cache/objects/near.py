"""Keep objects that were read or written on this machine's own disk, so that no volume is downloaded twice.

What is kept is named by its sha256 and compared with it whenever it is read, so the folder needs no other guard: a
file that is damaged, or deleted by anybody at any time, is read from the store again.
"""

import hashlib
import os
import re
import secrets
import threading
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from semidense.cache.errors import CacheUnavailable
from semidense.cache.files import remove

FOLDER_VARIABLE, BYTES_VARIABLE = "PIPELINE_NEAR", "PIPELINE_NEAR_BYTES"
"""Names of environment variables: the folder, and the most bytes that it may take; 0: nothing is kept."""
MOST_BYTES = 20 * 10**9
_BYTES = re.compile(r"\d{1,18}", re.ASCII)
_LEFT = 0.8
"""The part of the limit that is left after a cleaning."""


def near() -> "Near":
    """Return what this machine keeps, as the environment says.

    Raises:
        CacheUnavailable: if the limit is not a number of bytes.
    """
    from platformdirs import user_cache_path

    folder = os.environ.get(FOLDER_VARIABLE) or user_cache_path("semidense-stereo-near", appauthor=False)
    text = os.environ.get(BYTES_VARIABLE) or str(MOST_BYTES)
    if not _BYTES.fullmatch(text):
        raise CacheUnavailable(f"{BYTES_VARIABLE} is {text!r}: write a number of bytes, such as {MOST_BYTES}, or 0")
    return _near(Path(folder).expanduser(), int(text))


@lru_cache(8)
def _near(folder: Path, most: int) -> "Near":
    return Near(folder, most)


class Near:
    """A folder of objects by their sha256, of at most so many bytes; those read longest ago go first."""

    def __init__(self, folder: Path, most: int) -> None:
        self._folder, self._most = folder, most
        self._bytes: int | None = None
        self._lock = threading.Lock()

    def get(self, sha256: str) -> bytes | None:
        """Return the bytes that have this hash; None if they are not kept."""
        path = self._path(sha256)
        try:
            data = path.read_bytes()
        except OSError:
            return None
        if hashlib.sha256(data).hexdigest() != sha256:
            remove(path)
            return None
        with suppress(OSError):
            os.utime(path)
        return data

    def keep(self, sha256: str, data: bytes) -> None:
        """Keep bytes under their hash; what cannot be kept is left out."""
        path = self._path(sha256)
        if len(data) > self._most or path.exists():
            return
        temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            temporary.write_bytes(data)
            temporary.replace(path)
        except OSError:
            remove(temporary)
            return
        self._count(len(data))

    def _path(self, sha256: str) -> Path:
        return self._folder / sha256[:2] / sha256

    def _count(self, added: int) -> None:
        """Note that bytes were added, and make room if they are too many; other processes' are counted now and then."""
        with self._lock:
            self._bytes = None if self._bytes is None else self._bytes + added
            if self._bytes is None or self._bytes > self._most:
                self._bytes = self._make_room()

    def _make_room(self) -> int:
        """Delete what was read longest ago while the folder is over its limit; return the bytes that are left."""
        files = sorted(_files(self._folder))
        total = sum(size for _, size, _ in files)
        goal = total if total <= self._most else _LEFT * self._most
        for _, size, path in files:
            if total <= goal:
                break
            remove(path)
            total -= size
        return total


def _files(folder: Path) -> list[tuple[float, int, Path]]:
    """Return each file's time, size and path; one that vanishes meanwhile is left out."""
    found = []
    for path in folder.glob("[0-9a-f][0-9a-f]/*"):
        with suppress(OSError):
            status = path.stat()
            found.append((status.st_mtime, status.st_size, path))
    return found
