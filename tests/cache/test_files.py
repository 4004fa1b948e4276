import errno
import hashlib
import os
import subprocess
import sys
import threading
import time
from collections import deque
from pathlib import Path

import pytest

from semidense.cache import files
from semidense.cache.errors import CacheUnavailable, DamagedEntry
from semidense.cache.files import (
    THREADS,
    hash_file,
    in_threads,
    make_folder,
    remove,
    walk,
    write_new,
    write_whole,
    writing,
)


@pytest.mark.parametrize(
    ("number", "advice"),
    [
        (errno.ENOSPC, "No space left on device; free some space"),
        (errno.EDQUOT, "free some space"),
        (errno.EROFS, "Read-only file system; choose a cache folder that can be written"),
        (errno.EACCES, "Permission denied; check its permissions"),
        (errno.ENOTDIR, "choose another cache folder"),
        (errno.EFBIG, "File too large; raise the limit"),
        (errno.EMFILE, "Too many open files; raise the limit on open files"),
        (errno.EPERM, "Operation not permitted; check its permissions"),
        (errno.ESTALE, "Stale file handle; choose another cache folder"),
    ],
)
def test_failures_are_explained_in_one_line(number: int, advice: str) -> None:
    line = rf"^cannot write to the cache at /x: [^\n]*{advice}[^\n]*$"
    with pytest.raises(CacheUnavailable, match=line), writing(Path("/x")):
        raise OSError(number, os.strerror(number))


def test_the_cache_s_own_errors_pass() -> None:
    with pytest.raises(DamagedEntry, match=r"^mine$"), writing(Path("/x")):
        raise DamagedEntry("mine")


def test_read_only_trees_can_be_removed_and_links_are_not_followed(tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    make_folder(outside)
    write_new(outside / "kept", b"1")
    inner = tmp_path / "tree" / "inner"
    make_folder(inner)
    write_new(inner / "file", b"2")
    (inner / "link").symlink_to(outside)
    for folder in (inner, inner.parent):
        folder.chmod(0o555)
    assert sorted(path for path, _ in walk(tmp_path / "tree")) == ["inner", "inner/file", "inner/link"]
    remove(tmp_path / "tree")
    assert sorted(path for path, _ in walk(tmp_path)) == ["outside", "outside/kept"]


def test_written_files_are_read_only_and_never_replaced(tmp_path: Path) -> None:
    write_new(tmp_path / "file", b"1")
    assert (tmp_path / "file").stat().st_mode & 0o222 == 0
    with pytest.raises(FileExistsError):
        write_new(tmp_path / "file", b"2")


def test_threads_keep_order_and_pass_errors_on() -> None:
    assert in_threads(lambda x: x * x, range(50)) == [x * x for x in range(50)]
    with pytest.raises(ZeroDivisionError):
        in_threads(lambda x: 1 // x, [1, 0])


def test_no_thread_begins_another_item_after_an_error() -> None:
    begun: list[int] = []

    def fail(number: int) -> None:
        begun.append(number)
        time.sleep(0.01)
        raise ValueError(number)

    with pytest.raises(ValueError, match=r"[0-3]"):
        in_threads(fail, range(1000))
    assert len(begun) <= THREADS


def test_threads_take_the_next_item_when_they_are_done() -> None:
    slow = threading.Event()

    def work(number: int) -> int:
        if number == 0:
            assert slow.wait(60)  # the other threads do all the rest meanwhile
        elif number == 99:
            slow.set()
        return number

    assert in_threads(work, range(100)) == [*range(100)]


def test_importing_the_cache_is_light() -> None:
    heavy = "{'numpy', 'zarr', 'xarray', 'dask', 'pandas', 'numcodecs'}"
    code = f"import sys, cache, semidense.cache.upkeep.verify; print(sorted({heavy} & set(sys.modules)))"
    project = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=project, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("size", [0, 1, (1 << 18) - 1, 1 << 18, (1 << 18) + 1, (1 << 20) + 3])
def test_every_byte_of_a_file_is_hashed(tmp_path: Path, size: int) -> None:
    data = bytearray(os.urandom(size))
    (tmp_path / "file").write_bytes(data)
    assert hash_file(tmp_path / "file") == hash_file(f"{tmp_path}/file") == hashlib.sha256(data).hexdigest()
    if size:
        data[-1] ^= 1
        assert hash_file(tmp_path / "file") != hashlib.sha256(data).hexdigest()


def test_a_whole_file_replaces_the_former_one(tmp_path: Path) -> None:
    for text in (b"old", b"new"):
        write_whole(tmp_path / "folder/file", text)
    assert [(path.name, path.read_bytes()) for path in (tmp_path / "folder").iterdir()] == [("file", b"new")]


def test_a_whole_file_that_cannot_take_its_place_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "file/inside").mkdir(parents=True)
    with pytest.raises(OSError, match="file"):
        write_whole(tmp_path / "file", b"data")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


class Slow(deque):
    """A queue that waits once the last thing was taken, so that others find it empty."""

    def popleft(self) -> object:
        item = super().popleft()
        if not self:
            time.sleep(0.02)
        return item


def test_threads_that_find_nothing_left_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "deque", Slow)
    assert in_threads(lambda x: x * x, range(8)) == [x * x for x in range(8)]
