"""Move damaged entries aside: nothing is lost, and the product is made again."""

import logging
from contextlib import suppress
from pathlib import Path

from semidense.cache.entries.backend import Policy
from semidense.cache.entries.check import inspect
from semidense.cache.errors import CacheUnavailable, DamagedEntry, EntryNotFound
from semidense.cache.files import make_folder, move_folder, writing
from semidense.cache.layout import Layout
from semidense.cache.processes.locks import held

_log = logging.getLogger("semidense.cache")


def set_aside_if_damaged(layout: Layout, key: str, policy: Policy) -> None:
    """Look again, alone this time, and move the entry to quarantine if it is damaged indeed.

    Another process may have moved it, or made it anew, since it was found damaged. A cache that
    cannot be written keeps the entry: every later look finds the damage again.

    Raises:
        CacheUnavailable: if the file system refuses to read.
    """
    try:
        layout.create()
        with held(layout.lock("commit", key)), suppress(EntryNotFound):
            try:
                inspect(layout, key, policy)
            except DamagedEntry as error:
                set_aside(layout, key, str(error))
    except CacheUnavailable as error:
        _log.warning("a damaged entry stays in place: %s", error)


def set_aside(layout: Layout, key: str, reason: str) -> Path:
    """Move an entry's record, then its data, to a new folder in quarantine; the caller holds the commit lock.

    The record goes first: killed in between, this leaves data without a record, which nobody sees.

    Raises:
        CacheUnavailable: if the file system refuses.
    """
    target = layout.new_quarantine(key)
    with writing(target):
        make_folder(target)
        (target / "reason.txt").write_text(f"{reason}\n", encoding="utf-8")
        with suppress(FileNotFoundError):
            layout.record(key).rename(target / "record.json")
        with suppress(FileNotFoundError):
            move_anything(layout.entry(key), target / "entry")
    _log.warning("%s; moved to %s, it will be made again", reason, target)
    return target


def move_anything(source: Path, target: Path) -> None:
    """Rename whatever is at ``source``: a folder should be, a link or a file might be."""
    if source.is_dir() and not source.is_symlink():
        move_folder(source, target)
    else:
        source.rename(target)
