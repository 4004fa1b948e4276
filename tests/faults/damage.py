"""Damage to the files of an entry: each fault once, for the tests of the cache and for the fault matrix."""

import os
import shutil
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path

from semidense.cache import Store
from semidense.cache.document import seal, unseal
from semidense.cache.files import walk

Damage = Callable[[Path, Path], object]
"""Does something to an entry's folder and record."""


def overwrite(path: Path, data: bytes) -> None:
    """Replace the content of a read-only file."""
    path.chmod(0o600)
    path.write_bytes(data)


def files_of(store: Store, key: str) -> dict[str, Path]:
    """Return every file of an entry by its path inside, and the record."""
    folder = store.layout.entry(key)
    files = {path: folder / path for path, thing in walk(folder) if thing.is_file()}
    return {**files, "record": store.layout.record(key)}


def unlock(store: Store, key: str) -> None:
    """Make an entry's folders writable, so that files in them can be removed by whoever is not root."""
    entry = store.layout.entry(key)
    inner = [entry / path for path, thing in walk(entry) if thing.is_dir(follow_symlinks=False)]
    for folder in (entry, *inner, store.layout.record(key).parent):
        folder.chmod(0o755)


def flips(path: Path, offsets: range | None = None) -> Iterator[int]:
    """Flip a bit at each offset of a file in turn; the file is whole again after each."""
    good = path.read_bytes()
    path.chmod(0o600)
    with path.open("r+b", buffering=0) as file:
        for offset in offsets or range(len(good)):
            file.seek(offset)
            file.write(bytes([good[offset] ^ 1 << offset % 8]))
            yield offset
            file.seek(offset)
            file.write(good[offset : offset + 1])


def chunk(folder: Path, number: int = 0) -> Path:
    """Return one of an entry's chunks; the last, if there are not so many."""
    chunks = [path for path in sorted(folder.glob("data.zarr/*/c/**/*")) if path.is_file()]
    return chunks[min(number, len(chunks) - 1)]


def _aside(path: Path) -> Path:
    """Return this path with a number behind it at which nothing is yet: the same damage may strike twice."""
    return next(each for number in count() if not os.path.lexists(each := path.with_name(f"{path.name}-{number}")))


def _array(folder: Path) -> Path:
    return next(path.parent for path in sorted(folder.glob("data.zarr/*/zarr.json")))


def _swap(folder: Path, _: Path) -> None:
    first, second = chunk(folder), chunk(folder, 1)
    if first == second:  # of an array of one chunk: with its metadata
        second = _array(folder) / "zarr.json"
    first.rename(folder / "x")
    second.rename(first)
    (folder / "x").rename(second)


def _link(folder: Path, _: Path) -> None:
    path, copy = chunk(folder), _aside(folder.parent / "copy")
    shutil.copy(path, copy)
    path.unlink()
    path.symlink_to(copy)


def _link_folder(folder: Path, _: Path) -> None:
    array, copy = _array(folder), _aside(folder.parent / "copied")
    shutil.copytree(array, copy)
    shutil.rmtree(array)
    array.symlink_to(copy)


def _link_entry(folder: Path, _: Path) -> None:
    folder.symlink_to(folder.rename(_aside(folder.with_name("moved"))))


def _pipe(folder: Path, _: Path) -> None:
    path = chunk(folder)
    path.unlink()
    os.mkfifo(path)


def _manifest_with_its_own_checksum(folder: Path, _: Path) -> None:
    path = folder / "manifest.json"
    rows = unseal("manifest", path.read_bytes())["files"]
    overwrite(path, seal("manifest", {"files": rows[1:]}))
    (folder / rows[0][0]).unlink()
    if not any((folder / rows[0][0]).parent.iterdir()):
        (folder / rows[0][0]).parent.rmdir()


def _edited(path: Path, old: bytes, new: bytes) -> None:
    data = path.read_bytes()
    if old not in data:
        raise LookupError(f"{path} holds no {old!r}: choose another edit")
    overwrite(path, data.replace(old, new))


DAMAGE: dict[str, Damage] = {
    "truncated chunk": lambda f, r: overwrite(chunk(f), chunk(f).read_bytes()[:-1]),
    "empty chunk": lambda f, r: overwrite(chunk(f), b""),
    "appended to a chunk": lambda f, r: overwrite(chunk(f), chunk(f).read_bytes() + b"\0"),
    "deleted chunk": lambda f, r: chunk(f).unlink(),
    "extra chunk": lambda f, r: shutil.copy(chunk(f), chunk(f).with_name("7")),
    "extra file": lambda f, r: (f / "notes").write_text("x"),
    "extra folder": lambda f, r: (f / "data.zarr/empty").mkdir(),
    "extra link": lambda f, r: (f / "data.zarr/here").symlink_to("/"),
    "swapped files of different size": _swap,
    "link to the very same bytes": _link,
    "link to the very same folder": _link_folder,
    "link in place of the entry": _link_entry,
    "a pipe, which would wait for ever": _pipe,
    "no manifest": lambda f, r: (f / "manifest.json").unlink(),
    "empty manifest": lambda f, r: overwrite(f / "manifest.json", b""),
    "manifest and files edited alike": _manifest_with_its_own_checksum,
    "no entry": lambda f, r: f.rename(_aside(f.with_name("gone"))),
    "truncated record": lambda f, r: overwrite(r, r.read_bytes()[:-1]),
    "empty record": lambda f, r: overwrite(r, b""),
    "zeroed record": lambda f, r: overwrite(r, bytes(len(r.read_bytes()))),
    "edited label": lambda f, r: _edited(r, b'"scene": "', b'"scene": "X'),
    "edited time": lambda f, r: _edited(r, b'"created": "2', b'"created": "3'),
    "newer format": lambda f, r: _edited(r, b'mat": 1', b'mat": 2'),
    "older format": lambda f, r: _edited(r, b'mat": 1', b'mat": 0'),
    "record is a link": lambda f, r: r.symlink_to(r.rename(_aside(f.parent / "r"))),
    "record is a folder": lambda f, r: (r.unlink(), r.mkdir()),
    "record is a pipe": lambda f, r: (r.unlink(), os.mkfifo(r)),
}
"""Faults that a look at names and sizes finds; one that keeps them needs the full check."""

SAME_SIZE: dict[str, Damage] = {
    "zeroed chunk": lambda f, r: overwrite(chunk(f), bytes(chunk(f).stat().st_size)),
    "zeroed metadata": lambda f, r: overwrite(_array(f) / "zarr.json", bytes((_array(f) / "zarr.json").stat().st_size)),
    "reversed chunk": lambda f, r: overwrite(chunk(f), chunk(f).read_bytes()[::-1]),
}
