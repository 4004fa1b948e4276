"""Remember the checksums of what was fetched: a file that can be committed and shared.

Publishers of these benchmarks publish no checksums. The first fetch of an address is trusted, and its sha256 recorded;
from then on, and for everybody who has the file, other bytes at that address are refused::

    {
      "https://.../MiddEval3-data-Q.zip": {"bytes": 29430612, "sha256": "a1411f..."}
    }
"""

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from semidense.datasets.errors import FetchError
from semidense.datasets.formats.atomic import atomic_write
from semidense.datasets.formats.files import read_bytes

_LARGEST = 1 << 24
_SHA256 = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True)
class Lock:
    """The checksums in a file.

    Attributes:
        path: The file; it need not exist.
    """

    path: Path

    def digest(self, address: str) -> str | None:
        """Return the sha256 recorded for an address, in hex; None for one that was never fetched.

        Raises:
            FetchError: If the file is damaged.
        """
        entry = self._entries().get(address)
        return None if entry is None else str(entry["sha256"])

    def record(self, address: str, digest: str, size: int) -> None:
        """Write the checksum of an address into the file.

        Raises:
            FetchError: If the file is damaged.
            OSError: If it cannot be written.
        """
        entries = self._entries() | {address: {"bytes": size, "sha256": digest}}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(self.path) as file:
            file.write((json.dumps(entries, indent=2, sort_keys=True) + "\n").encode())

    def _entries(self) -> dict[str, Any]:
        if not self.path.exists():
            return {}
        try:
            entries = json.loads(read_bytes(self.path, _LARGEST, FetchError, "lock file"))
            valid = all(_SHA256.fullmatch(entry["sha256"]) for entry in entries.values())
        except (ValueError, TypeError, KeyError, AttributeError):
            valid = False
        if not valid:
            raise FetchError(f"{self.path}: no valid lock file; restore it, or name another one with --lock")
        return dict(entries)
