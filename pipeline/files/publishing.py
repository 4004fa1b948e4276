"""Put new files into a folder all together, and replace only files that an earlier command wrote there.

A command that writes a folder leaves a record in it, a JSON file with a list ``files``. A file that no record names
belongs to somebody else and is never replaced. Nor is a file that the command reads.
"""

import json
import secrets
import shutil
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from semidense.datasets.formats.atomic import atomic_write
from semidense.pipeline.files.writing import explaining, require_writable, writable_folder
from semidense.pipeline.plan.errors import UsageError


@contextmanager
def publishing(
    folder: Path, record: str, inputs: Collection[Path] = (), obsolete: Collection[str] = ()
) -> Iterator[Path]:
    """Give a hidden folder for new files, and move them into ``folder`` when the block ends well.

    While they are moved, the record has ``"unfinished": true``: it comes last, so a folder whose record lacks that
    mark holds all that the record names.

    Args:
        folder: where the files go; made if it is missing.
        record: name of the record, which the block writes like any other file.
        inputs: files that the command reads.
        obsolete: names of files to delete if an earlier record lists them and this one does not.

    Raises:
        UsageError: if the folder cannot be written, or a file of somebody else would be replaced. Then no file changes.
    """
    writable_folder(folder)
    draft = folder / f".new-{secrets.token_hex(4)}"
    with explaining(folder):
        draft.mkdir()
        try:
            yield draft
            _publish(draft, folder, record, inputs, frozenset(obsolete))
        finally:
            shutil.rmtree(draft, ignore_errors=True)


def _publish(draft: Path, folder: Path, record: str, inputs: Collection[Path], obsolete: frozenset[str]) -> None:
    names = {path.relative_to(draft).as_posix() for path in draft.rglob("*") if path.is_file()}
    refuse_foreign(folder, record, names, inputs)
    earlier = written_before(folder, record)
    begun = read_record(folder, record) | {"files": sorted(earlier | names), "unfinished": True}
    _write_record(folder / record, begun)
    for name in sorted(names - {record}):
        (folder / name).parent.mkdir(exist_ok=True)
        (draft / name).replace(folder / name)
    for path in (folder / name for name in sorted((earlier & obsolete) - names)):
        path.unlink(missing_ok=True)
        with suppress(OSError):
            path.parent.rmdir()  # of a scene, once it is empty
    (draft / record).replace(folder / record)


def _write_record(path: Path, content: dict[str, Any]) -> None:
    with atomic_write(path) as file:
        file.write((json.dumps(content, indent=2) + "\n").encode())


def refuse_foreign(folder: Path, record: str, names: Iterable[str], inputs: Iterable[Path] = ()) -> None:
    """Refuse files that would replace an input, or what no earlier command wrote.

    Raises:
        UsageError: with the first such file.
    """
    read, ours = {path.resolve() for path in inputs}, written_before(folder, record)
    for path in (folder / name for name in sorted(names)):
        if path.resolve() in read:
            raise UsageError(f"{path}: the command reads this file and would overwrite it; name another folder with -o")
        if path.relative_to(folder).as_posix() not in ours and (path.exists() or path.is_symlink()):
            raise UsageError(
                f"{path}: this file was not written by an earlier command of this kind ({record} does not name it); "
                "move it, or name another folder with -o"
            )


def require_place(folder: Path, record: str, names: Iterable[str]) -> None:
    """Refuse a folder before anything is made that will be written there: that takes long. It is not made.

    Raises:
        UsageError: if it, or the nearest folder above it that there is, is a file or closed to this user; or with the
            first file of somebody else that would be replaced.
    """
    require_writable(folder)
    refuse_foreign(folder, record, names)


def read_record(folder: Path, record: str) -> dict[str, Any]:
    """Return what the record of an earlier command holds; nothing without a record."""
    try:
        found = json.loads((folder / record).read_text())
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def written_before(folder: Path, record: str) -> set[str]:
    """Return the names in the record of an earlier command, and the record's own; nothing without a record."""
    try:
        return {_relative(each, folder) for each in read_record(folder, record)["files"]} | {record}
    except (ValueError, LookupError, TypeError, AttributeError):
        return set()


def _relative(listed: str | dict[str, str], folder: Path) -> str:
    """Return a listed file's name within the folder; records list names, objects with a ``file``, or paths."""
    name = listed if isinstance(listed, str) else listed["file"]
    return Path(name).relative_to(folder).as_posix() if Path(name).is_relative_to(folder) else name
