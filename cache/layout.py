"""Where everything is inside a cache's folder.

::

    ROOT/records/ab/KEY.json        makes the entry exist; written last
    ROOT/entries/ab/KEY/            manifest.json and data.zarr/; invisible without a record
    ROOT/drafts/OWNER-RANDOM/       work in progress, seen by its owner alone
    ROOT/quarantine/KEY-RANDOM/     damaged entries, moved aside
    ROOT/locks/                     held locks
    ROOT/leases/OWNER-RANDOM        the keys that a running process uses: nobody cleans them away
    ROOT/sources/ab/HASH.py         the text of each module that made an entry, to say later what changed
    ROOT/checkpoints/KEY            states of long work, until its product is there
    ROOT/CACHEDIR.TAG               tells backup programs to skip it
"""

import re
import secrets
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from semidense.cache.errors import InvalidKey
from semidense.cache.files import make_folder, writing
from semidense.cache.owner import owner

_KEY = re.compile(r"[0-9a-f]{64}", re.ASCII)
_TAG = "Signature: 8a477f597d28d172789f06886806bc55\n# This folder is a cache: all in it can be made again.\n"


@dataclass(frozen=True)
class Layout:
    """The paths of a cache in the folder ``root``; building one touches nothing."""

    root: Path

    @property
    def drafts(self) -> Path:
        """Where work in progress is."""
        return self.root / "drafts"

    @property
    def entries(self) -> Path:
        """Where the data of entries are."""
        return self.root / "entries"

    @property
    def quarantine(self) -> Path:
        """Where damaged entries are moved."""
        return self.root / "quarantine"

    @property
    def locks(self) -> Path:
        """Where held locks are."""
        return self.root / "locks"

    @property
    def leases(self) -> Path:
        """Where running processes say what they use."""
        return self.root / "leases"

    @property
    def checkpoints(self) -> Path:
        """Where the states of long work are."""
        return self.root / "checkpoints"

    def record(self, key: str) -> Path:
        """Return the file whose existence makes the entry exist."""
        return self.root / "records" / require_key(key)[:2] / f"{key}.json"

    def entry(self, key: str) -> Path:
        """Return the folder of the entry's manifest and data."""
        return self.entries / require_key(key)[:2] / key

    def lock(self, name: str, key: str) -> Path:
        """Return the file of one of the key's locks."""
        return self.locks / f"{require_key(key)}.{name}"

    def source(self, code_hash: str) -> Path:
        """Return the file of a module's text, by the hash of its code."""
        return self.root / "sources" / require_key(code_hash)[:2] / f"{code_hash}.py"

    def checkpoint(self, key: str) -> Path:
        """Return the file of the latest state of work on ``key``."""
        return self.checkpoints / require_key(key)

    def new_lease(self) -> Path:
        """Return a path for a lease that nobody else has; it says whose it is."""
        return self.leases / f"{owner()}-{secrets.token_hex(8)}"

    def new_draft(self) -> Path:
        """Return a path for a draft that nobody else has; it says whose it is."""
        return self.drafts / f"{owner()}-{secrets.token_hex(8)}"

    def new_quarantine(self, key: str) -> Path:
        """Return a path in quarantine that nobody else has."""
        return self.quarantine / f"{require_key(key)}-{secrets.token_hex(4)}"

    def record_keys(self) -> Iterator[str]:
        """Yield the key of each record, well-formed or not, in order."""
        return _keys(self.root / "records", ".json")

    def entry_keys(self) -> Iterator[str]:
        """Yield the key of each entry's folder, with or without a record, in order."""
        return _keys(self.entries, "")

    def create(self) -> None:
        """Make the cache's folders, if they are not there yet.

        Raises:
            CacheUnavailable: if they cannot be made.
        """
        with writing(self.root):
            for folder in ("records", "entries", "drafts", "quarantine", "locks", "leases"):
                make_folder(self.root / folder)
            tag = self.root / "CACHEDIR.TAG"
            if not tag.exists() or tag.stat().st_size != len(_TAG):  # a disk that was full may have left a part
                tag.write_text(_TAG, encoding="ascii")


def is_key(text: str) -> bool:
    """Return whether a text has the form of a key."""
    return _KEY.fullmatch(text) is not None


def require_key(key: str) -> str:
    """Return ``key`` if it is one: a key becomes part of a path.

    Raises:
        InvalidKey: if it is not 64 lower-case hexadecimal digits.
    """
    if not isinstance(key, str) or not _KEY.fullmatch(key):
        raise InvalidKey(f"{key!r} is not a key: expected the 64 hexadecimal digits of a sha256")
    return key


def _keys(folder: Path, suffix: str) -> Iterator[str]:
    """Yield the keys in a folder of two-digit folders; what is not named like a key is not ours."""
    for path in sorted(folder.glob(f"??/*{suffix}")):
        key = path.name.removesuffix(suffix)
        if _KEY.fullmatch(key) and path.name == key + suffix and path.parent.name == key[:2]:
            yield key
