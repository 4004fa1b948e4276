"""Checkpoints of long work, kept beside the cache until the product is published."""

import hashlib
from collections.abc import Callable
from pathlib import Path

from semidense.cache.files import reading, writing
from semidense.cache.layout import Layout
from semidense.datasets.formats.atomic import atomic_write

Report = Callable[[int, int, str], None]
_DIGEST = hashlib.sha256().digest_size


class Checkpoints:
    """The ``Monitor`` of one product in the making: reports to a function, keeps checkpoints under its key.

    A checkpoint belongs to a key, so work with other settings, code or inputs never resumes from it. Its
    file starts with the sha256 of the rest: from one that is damaged nothing resumes either.
    """

    def __init__(self, root: Path, key: str, report: Report | None = None) -> None:
        self.file = Layout(root).checkpoint(key)
        self._report = report

    def progress(self, done: int, total: int, note: str = "") -> None:
        """Report how far the work is."""
        if self._report:
            self._report(done, total, note)

    def save(self, state: bytes) -> None:
        """Keep a checkpoint; a reader sees the old one or the new one, never a part.

        Raises:
            CacheUnavailable: if the cache's folder cannot be written.
        """
        with writing(self.file):
            self.file.parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(self.file) as file:
                file.write(hashlib.sha256(state).digest() + state)

    def load(self) -> bytes | None:
        """Return the latest checkpoint; None if there is none, or it is not what was saved.

        Raises:
            CacheUnavailable: if the file system refuses.
        """
        with reading(self.file):
            if not self.file.is_file():
                return None
            data = self.file.read_bytes()
        state = data[_DIGEST:]
        return state if hashlib.sha256(state).digest() == data[:_DIGEST] else None

    def remove(self) -> None:
        """Delete the checkpoint, and what a killed writer left of one: the product is there."""
        with writing(self.file):
            for file in (self.file, *self.file.parent.glob(f".{self.file.name}.*")):
                file.unlink(missing_ok=True)
