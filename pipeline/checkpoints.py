"""Checkpoints of long work, kept beside the cache until the product is published."""

from collections.abc import Callable
from pathlib import Path

Report = Callable[[int, int, str], None]


class Checkpoints:
    """The ``Monitor`` of one product in the making: reports to a function, keeps checkpoints under its key.

    A checkpoint belongs to a key, so work with other settings, code or inputs never resumes from it.
    """

    def __init__(self, root: Path, key: str, report: Report | None = None) -> None:
        self.file = root / "checkpoints" / f"{key}.safetensors"
        self._report = report

    def progress(self, done: int, total: int, note: str = "") -> None:
        """Report how far the work is."""
        if self._report:
            self._report(done, total, note)

    def save(self, state: bytes) -> None:
        """Keep a checkpoint; a reader sees the old one or the new one, never a part."""
        self.file.parent.mkdir(parents=True, exist_ok=True)
        fresh = self.file.with_suffix(".new")
        fresh.write_bytes(state)
        fresh.replace(self.file)

    def load(self) -> bytes | None:
        """Return the latest checkpoint, or None."""
        return self.file.read_bytes() if self.file.is_file() else None

    def remove(self) -> None:
        """Delete the checkpoint: the product is there."""
        self.file.unlink(missing_ok=True)
