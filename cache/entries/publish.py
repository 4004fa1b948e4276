"""How an entry comes to exist: data first, record last.

1. every chunk is there, and nothing else;
2. each file is hashed and made read-only;
3. the manifest is written, and the folders are made read-only;
4. the record is written beside the draft;
5. the draft is renamed to its place among the entries; nobody sees it yet;
6. all files, the record and all folders are synced at one time: a disk needs little longer for many than for one;
7. the record is linked to its name: now the entry exists.

Several small results of one writer go through steps 4 to 7 together, so that they are synced at one time.

A kill at any point leaves a whole entry or nothing that anybody sees, and another process of the same
run can go on from there: ``resume`` finds the data that were renamed by the record beside the draft.
A second writer of the same
key compares digests and drops its own copy. The commit lock spares two writers from tripping over
each other; should it fail, as on some network disks, the link still lets only one record win,
and a record never fits another content.
"""

import os
import secrets
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path

from semidense.cache.entries.check import MANIFESTS, RECORDS, inspect, inspect_data, read_plain
from semidense.cache.entries.encoded import Encoded
from semidense.cache.entries.entry import MANIFEST, Entry, File, Manifest, folders_of
from semidense.cache.entries.quarantine import move_anything, set_aside
from semidense.cache.errors import DamagedEntry, EntryNotFound, NonDeterministicStage
from semidense.cache.files import (
    add_folder,
    hash_file,
    in_threads,
    make_new_folders,
    make_read_only,
    move_folder,
    remove,
    shared_out,
    sync,
    walk,
    write_new,
    writing,
)
from semidense.cache.layout import Layout
from semidense.cache.processes.locks import held

STEPS = (
    "begun",
    "array created",
    "chunk written",
    "complete",
    "hashed",
    "manifest written",
    "sealed",
    "locked",
    "record written",
    "cleared",
    "renamed",
    "entry synced",
    "record linked",
    "published",
)
"""The steps of the protocol, in order; ``STEP_HOOK`` is told each when it is done."""

STEP_HOOK: Callable[[str], None] = lambda _: None  # noqa: E731 - replaced by tests, to kill the process there


def remove_strays(folder: Path, expected: Iterable[str]) -> None:
    """Delete what a killed writer left in a draft, such as a half-written temporary file or an empty folder."""
    files = set(expected)
    folders = folders_of(files)
    for path, thing in list(walk(folder)):
        if path not in (folders if thing.is_dir(follow_symlinks=False) else files):
            remove(folder / path)


def seal(draft: Path, paths: Iterable[str]) -> Manifest:
    """Hash the draft's files, write their manifest, and make all of it read-only."""
    names = sorted(paths)
    files = [f"{draft}/{name}" for name in names]
    sizes = [make_read_only(file) for file in files]
    hashes = shared_out(hash_file, files, sum(sizes))
    manifest = Manifest(tuple(map(File, names, sizes, hashes)))
    STEP_HOOK("hashed")
    _close(draft, manifest)
    return manifest


def _close(draft: Path, manifest: Manifest) -> None:
    """Write the manifest of a draft's files, and make its folders read-only."""
    data = manifest.to_bytes()
    write_new(draft / MANIFEST, data)
    MANIFESTS.keep(manifest, data)
    STEP_HOOK("manifest written")
    for folder in manifest.folders:  # not the draft itself: it is still to be renamed, which changes its ".."
        make_read_only(f"{draft}/{folder}")
    STEP_HOOK("sealed")


def write_result(draft: Path, result: Encoded) -> Entry:
    """Write a result as a sealed draft, and return its entry.

    Each folder is made inside one that must be there: a draft that is deleted meanwhile does not come back.
    """
    make_new_folders([str(draft), *(f"{draft}/{folder}" for folder in sorted(result.manifest.folders))])
    STEP_HOOK("begun")
    for path, data in result.files.items():
        write_new(f"{draft}/{path}", data)
    STEP_HOOK("chunk written")
    _close(draft, result.manifest)
    return result.entry()


def commit(layout: Layout, drafts: Mapping[Path, Entry]) -> list[Entry]:
    """Give sealed drafts their places and write their records; the drafts are gone afterwards.

    Returns:
        The entries in order, or those that another writer published first, if they are the same.

    Raises:
        NonDeterministicStage: if another writer published other content under a key; no draft is placed then.
        CacheUnavailable, OSError: if the file system refuses.
    """
    with ExitStack() as locks:
        for key in sorted(entry.key for entry in drafts.values()):  # in one order: nobody waits for each other
            locks.enter_context(held(layout.lock("commit", key)))
        STEP_HOOK("locked")
        theirs = {
            draft: found for draft, entry in drafts.items() if (found := _published(layout, draft, entry)) is not None
        }
        mine = {draft: entry for draft, entry in drafts.items() if draft not in theirs}
        for draft, entry in mine.items():
            _write_record(draft, entry)
        for draft, entry in mine.items():
            _place(layout, draft, entry)
        _settle(layout, {draft: entry.key for draft, entry in mine.items()})
        linked = {draft: _link_record(layout, draft, entry) for draft, entry in mine.items()}
        in_threads(sync, {str(layout.record(entry.key).parent) for entry in mine.values()})
    STEP_HOOK("published")
    return [{**theirs, **linked}[draft] for draft in drafts]


def resume(layout: Layout, draft: Path, key: str) -> Entry | None:
    """Return the entry that a draft became, after the last steps if its publisher was killed before them.

    None if the draft is still there, or became no entry.

    Raises:
        CacheUnavailable: if the file system refuses.
    """
    if draft.is_dir():
        return None
    with writing(draft), held(layout.lock("commit", key)):
        with suppress(EntryNotFound, DamagedEntry):
            return inspect(layout, key, "full").entry
        with suppress(FileNotFoundError, DamagedEntry):
            entry = Entry.from_bytes(key, read_plain(_record_beside(draft)))
            inspect_data(layout, entry, "full", remember=False)
            _settle(layout, {draft: key})
            found = _link_record(layout, draft, entry)
            sync(layout.record(key).parent)
            return found
    return None


def _published(layout: Layout, draft: Path, entry: Entry) -> Entry | None:
    """Return what another writer published under this key, if it is sound and the same."""
    try:
        found = inspect(layout, entry.key, "full")
    except EntryNotFound:
        return None
    except DamagedEntry as error:
        set_aside(layout, entry.key, str(error))
        return None
    require_same(found.entry, entry)
    remove(draft)
    return found.entry


def require_same(old: Entry, new: Entry) -> None:
    """Refuse a second result of the same recipe that differs from the first.

    Raises:
        NonDeterministicStage: naming both.
    """
    if old.digest != new.digest:
        raise NonDeterministicStage(
            f"{new.recipe.stage} gave two results from one recipe (key {new.key}): {old.digest} on {old.created}, "
            f"{new.digest} now; the first is kept: {_suspicion(old.extras.get('cpu'), new.extras.get('cpu'))}"
        )


def _suspicion(old: object, new: object) -> str:
    """Return what to look for, given the CPUs that two results were made on."""
    if old != new:
        names = [str(cpu or "an unknown CPU") for cpu in (old, new)]
        return f"the first was made on {names[0]}, the second on {names[1]}, which may round otherwise"
    return "find what its key lacks, or what is random in it"


def _place(layout: Layout, draft: Path, entry: Entry) -> None:
    """Rename the draft to the entry's folder; data without a record, of a writer killed here, make way."""
    target = layout.entry(entry.key)
    add_folder(target.parent)
    if os.path.lexists(target):
        orphan = draft.with_name(f"{draft.name}.{secrets.token_hex(4)}")
        move_anything(target, orphan)
        remove(orphan)
    STEP_HOOK("cleared")
    move_folder(draft, target)
    STEP_HOOK("renamed")


def _settle(layout: Layout, keys: Mapping[Path, str]) -> None:
    """Have the files of entries, the records beside their drafts, and all names on the way to them on disk.

    Args:
        layout: of the cache.
        keys: of the entries, each with the draft that it was.
    """
    waiting: dict[str, None] = {}
    for draft, key in keys.items():
        folder, shelf = layout.entry(key), layout.record(key).parent
        make_read_only(folder)
        add_folder(shelf)
        waiting.update((f"{folder}/{path}", None) for path, _ in walk(folder))
        waiting.update((str(path), None) for path in (folder, *folder.parents[:2], shelf.parent, _record_beside(draft)))
    in_threads(sync, waiting)
    STEP_HOOK("entry synced")


def _record_beside(draft: Path) -> Path:
    return draft.with_name(f"{draft.name}.json")


def _write_record(draft: Path, entry: Entry) -> None:
    """Write the record under another name, in place of one by a publisher that was killed."""
    remove(_record_beside(draft))
    data = entry.to_bytes()
    write_new(_record_beside(draft), data)
    RECORDS.keep(entry, data, entry.key)
    STEP_HOOK("record written")


def discard(draft: Path) -> None:
    """Delete a draft, and the record beside it."""
    remove(draft)
    remove(_record_beside(draft))


def _link_record(layout: Layout, draft: Path, entry: Entry) -> Entry:
    """Link the record, which is whole under another name: a link never replaces a record."""
    temporary, record = _record_beside(draft), layout.record(entry.key)
    try:
        record.hardlink_to(temporary)
    except FileExistsError:
        found = inspect(layout, entry.key, "full").entry
        require_same(found, entry)
        return found
    finally:
        remove(temporary)
    STEP_HOOK("record linked")
    return entry
