"""Checkpoints of long work, kept beside the cache until the product is published."""

import hashlib
from collections.abc import Callable

from semidense.cache import Checkpoint

Report = Callable[[int, int, str], None]
_DIGEST = hashlib.sha256().digest_size


class Checkpoints:
    """The ``Monitor`` of one product in the making: reports to a function, keeps checkpoints under its key.

    A checkpoint belongs to a key, so work with other settings, code or inputs never resumes from it. It
    starts with the sha256 of the rest: from one that is damaged nothing resumes either.
    """

    def __init__(self, kept: Checkpoint, report: Report | None = None) -> None:
        self.kept = kept
        self._report = report

    def progress(self, done: int, total: int, note: str = "") -> None:
        """Report how far the work is."""
        if self._report:
            self._report(done, total, note)

    def save(self, state: bytes) -> None:
        """Keep a checkpoint; a reader sees the old one or the new one, never a part.

        Raises:
            CacheUnavailable: if the cache cannot be written.
        """
        self.kept.save(hashlib.sha256(state).digest() + state)

    def load(self) -> bytes | None:
        """Return the latest checkpoint; None if there is none, or it is not what was saved.

        Raises:
            CacheUnavailable: if the cache refuses.
        """
        data = self.kept.load()
        if data is None or hashlib.sha256(data[_DIGEST:]).digest() != data[:_DIGEST]:
            return None
        return data[_DIGEST:]
