"""Where everything is inside a cache's folder.

::

    ROOT/records/ab/KEY.json        makes the entry exist; written last
    ROOT/entries/ab/KEY/            manifest.json and data.zarr/; invisible without a record
    ROOT/drafts/LEASE-HASH/         work in progress of the run that holds the lease
    ROOT/quarantine/KEY-RANDOM/     damaged entries, moved aside
    ROOT/locks/                     held locks
    ROOT/leases/LEASE               held locked by a run, with the keys that it uses: nobody cleans them away
    ROOT/sources/ab/HASH.py         the text of each module that made an entry, to say later what changed
    ROOT/checkpoints/KEY            states of long work, until its product is there
    ROOT/CACHEDIR.TAG               makes the folder a cache, and tells backup programs to skip it
"""

import hashlib
import os
import re
import secrets
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from semidense.cache.errors import CacheUnavailable, InvalidKey
from semidense.cache.files import is_folder, make_folder, reading, require_no_link, writing

_URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):(?:/+(.*))?", re.ASCII)  # of a URL alone, a path keeps no slash
SCHEMES = ("s3", "gs", "az", "memory")
"""Object stores that a cache can be in."""
_KEY = re.compile(r"[0-9a-f]{64}", re.ASCII)
_LEASE = "[0-9a-f]{32}"
_FORMS = {
    "drafts": re.compile(rf"{_LEASE}-[0-9a-f]{{64}}(\.json|\.[0-9a-f]{{8}})?", re.ASCII),
    "quarantine": re.compile(r"[0-9a-f]{64}-[0-9a-f]{8}", re.ASCII),
    "locks": re.compile(r"[0-9a-f]{64}\.(commit|making)|leases", re.ASCII),
    "leases": re.compile(_LEASE, re.ASCII),
    "checkpoints": re.compile(r"[0-9a-f]{64}|\.[0-9a-f]{64}\..*", re.ASCII),
}
"""How the things in each folder are named. What has another name is not the cache's, and stays."""
_FOLDERS = ("records", "entries", "drafts", "quarantine", "locks", "leases")
_LATER = ("sources", "checkpoints")
"""Folders that are made when they are needed."""
_TAG_NAME = "CACHEDIR.TAG"
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
        return self.root.joinpath("records", require_key(key)[:2], f"{key}.json")

    def entry(self, key: str) -> Path:
        """Return the folder of the entry's manifest and data."""
        return self.root.joinpath("entries", require_key(key)[:2], key)

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
        """Return a path for a lease that nobody else has."""
        return self.leases / secrets.token_hex(16)

    def draft(self, lease: str, key: str, maker: str) -> Path:
        """Return the folder in which a maker makes ``key`` for the run that holds a lease: always the same one."""
        name = hashlib.sha256(f"{require_key(key)} {maker}".encode()).hexdigest()
        return self.drafts / f"{lease}-{name}"

    def lease_of(self, draft: Path) -> Path:
        """Return the lease whose holder a draft belongs to."""
        return self.leases / draft.name.partition("-")[0]

    def new_draft(self, lease: str) -> Path:
        """Return a path among the drafts of a lease that nobody else has, such as for what is deleted."""
        return self.drafts / f"{lease}-{secrets.token_hex(32)}"

    def new_quarantine(self, key: str) -> Path:
        """Return a path in quarantine that nobody else has."""
        return self.quarantine / f"{require_key(key)}-{secrets.token_hex(4)}"

    def record_keys(self) -> Iterator[str]:
        """Yield the key of each record, well-formed or not, in order."""
        return _keys(self.root / "records", ".json")

    def entry_keys(self) -> Iterator[str]:
        """Yield the key of each entry's folder, with or without a record, in order."""
        return _keys(self.entries, "")

    def things(self, folder: Path) -> list[Path]:
        """Return what a folder of the cache holds under names of the cache's own form, in order.

        A folder that is missing holds nothing; nor does a link in its place, which leads out of the cache.

        Raises:
            CacheUnavailable: if the file system refuses.
        """
        with reading(folder):
            names = sorted(path.name for path in folder.iterdir()) if is_folder(folder) else []
        return [folder / name for name in names if _FORMS[folder.name].fullmatch(name)]

    def require_cache(self) -> None:
        """Refuse a folder that holds files and no tag of this cache: they are somebody's, and are not to be touched.

        Raises:
            CacheUnavailable: if it is one, or the file system refuses.
        """
        with reading(self.root):
            names = [path.name for path in self.root.iterdir()] if os.path.lexists(self.root) else []
            strange = sorted(name for name in names if not name.startswith(_TAG_NAME))
            if strange and not self._is_tagged():
                raise CacheUnavailable(
                    f"{self.root} is not a cache: it holds {strange[0]!r} but no {_TAG_NAME} of this program; "
                    "choose a new or empty folder"
                )

    def create(self) -> None:
        """Make the cache's folders, if they are not there yet; the tag comes first.

        Raises:
            CacheUnavailable: if they cannot be made, or the folder holds files and is not a cache.
        """
        with writing(self.root):
            if self._is_whole():
                return
            if not (is_folder(self.root / "leases") and self._is_tagged()):
                if not self.root.is_dir():  # which may be a link: the user's own choice
                    make_folder(self.root)
                self.require_cache()
                self._write_tag()
            for folder in _FOLDERS:
                make_folder(self.root / folder)
            for folder in _LATER:
                require_no_link(self.root / folder)

    def _is_whole(self) -> bool:
        """Return whether the tag and all folders are there, none of them a link; asked often, so at one go."""
        try:
            with os.scandir(self.root) as things:
                folders = {thing.name: thing.is_dir(follow_symlinks=False) for thing in things}
        except (FileNotFoundError, NotADirectoryError):
            return False
        there = all(folders.get(name, False) for name in _FOLDERS) and all(folders.get(name, True) for name in _LATER)
        return there and self._is_tagged()

    def _is_tagged(self) -> bool:
        tag = self.root / _TAG_NAME
        return tag.is_file() and tag.read_bytes() == _TAG.encode("ascii")

    def _write_tag(self) -> None:
        temporary = self.root / f"{_TAG_NAME}.{secrets.token_hex(4)}"
        try:
            temporary.write_text(_TAG, encoding="ascii")
            temporary.replace(self.root / _TAG_NAME)
        finally:
            temporary.unlink(missing_ok=True)


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
    with reading(folder):
        shelves = sorted(folder.iterdir()) if is_folder(folder) else []
    for shelf in filter(is_folder, shelves):
        with reading(shelf):
            names = sorted(path.name for path in shelf.iterdir())
        for name in names:
            key = name.removesuffix(suffix)
            if _KEY.fullmatch(key) and name == key + suffix and shelf.name == key[:2]:
                yield key


def place_of(root: Path | str) -> Path | str:
    """Return a folder's absolute path, or the one spelling of a URL; a path has lost one of its slashes.

    Raises:
        CacheUnavailable: if it is a URL of another kind than ``SCHEMES``.
    """
    if any(ord(character) < ord(" ") for character in str(root)):
        raise CacheUnavailable(
            f"{str(root)!r} is no place for a cache: it holds a line break or another control character"
        )
    match = _URL.fullmatch(str(root))
    if match is None:
        return Path(root).absolute()
    if match[1].lower() not in SCHEMES or not match[2]:
        raise CacheUnavailable(
            f"{root} is no place for a cache: name a folder, or an object store as "
            + ", ".join(f"{scheme}://NAME/PREFIX" for scheme in SCHEMES[:3])
        )
    return f"{match[1].lower()}://{match[2].rstrip('/')}"
