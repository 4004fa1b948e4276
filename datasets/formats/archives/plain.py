"""Refuse an archive that holds anything but plain files and folders with names that stay inside the folder."""

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal, TypeAlias

from semidense.datasets.errors import ArchiveError

Kind: TypeAlias = Literal["file", "folder", "link", "device"]

LARGEST_RATIO = 100
"""Bytes that an archive may unpack to for each of its own: images and maps of disparities reach 5."""
FREE_BYTES = 1 << 20
"""Bytes that any archive may unpack to."""
MOST_MEMBERS = 50_000
"""Members that an archive may have; the largest benchmark has about 10,000."""
_LONGEST_NAME = 1024
_OUTSIDE = re.compile(r"/|[A-Za-z]:|.*\\", re.DOTALL)
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")


@dataclass(frozen=True)
class Member:
    """What an archive says of one of its members.

    Attributes:
        name: path inside the archive, with ``/`` between folders, as it is stored.
        kind: what it is.
        size: bytes when unpacked.
    """

    name: str
    kind: Kind
    size: int


def check_members(archive: Path, members: Iterable[Member], compressed: int) -> None:
    """Refuse an archive before a byte of it is unpacked; members are looked at one by one, and no further than needed.

    Args:
        archive: for the message.
        members: what it holds.
        compressed: its size, bytes.

    Raises:
        ArchiveError: With the first member that is a link or a device; leads out of the folder; has the name of
            another, in upper or lower case; stands in a file as if that were a folder; or exceeds `LARGEST_RATIO`.
    """
    budget, names = FREE_BYTES + LARGEST_RATIO * compressed, _Names()
    for count, member in enumerate(members):
        budget -= member.size
        reason = _of_member(member) or names.clash(member) or _of_amount(budget, count)
        if reason:
            raise ArchiveError(f"{archive}: nothing was unpacked, for {member.name[:200]!r} {reason}")


def _of_member(member: Member) -> str | None:
    if member.kind not in ("file", "folder"):
        return f"is a {member.kind}; only plain files and folders are unpacked"
    if _OUTSIDE.match(member.name) or ".." in PurePosixPath(member.name).parts:
        return "leads out of the folder"
    if _CONTROL.search(member.name) or len(member.name) > _LONGEST_NAME or not PurePosixPath(member.name).parts:
        return None if member.kind == "folder" and member.name in ("", ".", "./") else "is no name of a file"
    return None


def _of_amount(budget: int, count: int) -> str | None:
    if budget < 0:
        return f"makes it more than {LARGEST_RATIO} times as large as the archive"
    return f"is one of more than {MOST_MEMBERS:,} members" if count >= MOST_MEMBERS else None


class _Names:
    """The names so far, as a file system without upper and lower case would keep them."""

    def __init__(self) -> None:
        self._taken: dict[str, tuple[str, Kind]] = {}

    def clash(self, member: Member) -> str | None:
        """Say how a member collides with an earlier one, and remember it and the folders above it."""
        path = PurePosixPath(member.name)
        above = [folder for folder in reversed(path.parents) if folder.parts]
        found = [*(self._meet(folder, "folder") for folder in above), self._meet(path, member.kind)]
        return next((reason for reason in found if reason), None)

    def _meet(self, path: PurePosixPath, kind: Kind) -> str | None:
        name, key = path.as_posix(), unicodedata.normalize("NFC", path.as_posix()).casefold()
        known = self._taken.get(key)
        self._taken[key] = (name, kind)
        if known is None or (known == (name, kind) and kind == "folder"):
            return None
        if known[0] != name:
            return f"differs from {known[0]!r} in upper and lower case only"
        return "is there twice" if known[1] == kind else "is both a file and a folder"
