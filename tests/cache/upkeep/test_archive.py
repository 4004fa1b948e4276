"""Hostile archives are in `tests/faults/inputs.py`."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from semidense.cache import CacheUnavailable, DamagedArchive, DamagedEntry, Entry, EntryNotFound, Store
from semidense.cache.upkeep.archive import export_entries, import_entries
from tests.faults.damage import DAMAGE, unlock

Make = Callable[..., Entry]


@pytest.fixture
def other(tmp_path: Path) -> Store:
    return Store(tmp_path / "other")


def test_entries_come_in_as_they_went_out(
    store: Store, other: Store, make: Make, tmp_path: Path, values: np.ndarray
) -> None:
    entries = [make(store), make(store, values + 1, n=4)]
    file = tmp_path / "x.tar"
    assert sorted(entry.key for entry in export_entries(store, [entry.key for entry in entries], file)) == sorted(
        entry.key for entry in entries
    )
    assert [each.outcome for each in import_entries(other, file)] == ["added", "added"]
    assert list(other.entries()) == list(store.entries())
    assert [other.check(entry.key) for entry in entries] == [None, None]
    np.testing.assert_array_equal(other.open(entries[1].key)["map"].values, values + 1)
    assert [each.outcome for each in import_entries(other, file)] == ["there already", "there already"]
    assert list(other.layout.drafts.iterdir()) == []


def test_the_same_entries_make_the_same_archive(store: Store, make: Make, tmp_path: Path) -> None:
    key = make(store).key
    for name in "ab":
        export_entries(store, [key], tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_your_own_result_is_kept(store: Store, other: Store, make: Make, tmp_path: Path, values: np.ndarray) -> None:
    export_entries(store, [make(store).key], tmp_path / "x.tar")
    own = make(other, values + 1)
    assert [each.outcome for each in import_entries(other, tmp_path / "x.tar")] == ["differs: yours is kept"]
    assert other.require(own.key) == own


def test_a_damaged_entry_of_your_own_makes_way(store: Store, other: Store, make: Make, tmp_path: Path) -> None:
    entry = make(store)
    export_entries(store, [entry.key], tmp_path / "x.tar")
    make(other)
    unlock(other, entry.key)
    DAMAGE["truncated chunk"](other.layout.entry(entry.key), other.layout.record(entry.key))
    assert [each.outcome for each in import_entries(other, tmp_path / "x.tar")] == ["added"]
    assert other.check(entry.key) is None


def test_a_damaged_entry_is_not_exported(store: Store, make: Make, tmp_path: Path) -> None:
    entry = make(store)
    unlock(store, entry.key)
    DAMAGE["truncated chunk"](store.layout.entry(entry.key), store.layout.record(entry.key))
    (tmp_path / "x.tar").write_text("mine")
    with pytest.raises(DamagedEntry):
        export_entries(store, [entry.key], tmp_path / "x.tar")
    assert (tmp_path / "x.tar").read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cache", "x.tar"]


def test_what_is_not_there_is_not_exported(store: Store, tmp_path: Path) -> None:
    with pytest.raises(EntryNotFound):
        export_entries(store, ["ab" * 32], tmp_path / "x.tar")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_is_explained(store: Store, make: Make, tmp_path: Path) -> None:
    with pytest.raises(CacheUnavailable, match=r"cannot write the archive .*x\.tar: No such file or directory$"):
        export_entries(store, [make(store).key], tmp_path / "none" / "x.tar")


@pytest.mark.parametrize("text", [b"", b"x" * 2000, b"\x1f\x8b" + bytes(600)])
def test_what_is_no_archive_is_refused(other: Store, tmp_path: Path, text: bytes) -> None:
    (tmp_path / "x.tar").write_bytes(text)
    with pytest.raises(DamagedArchive, match=r"^[^\n]+$"):
        list(import_entries(other, tmp_path / "x.tar"))


def test_an_archive_that_is_not_there_is_refused(other: Store, tmp_path: Path) -> None:
    with pytest.raises(DamagedArchive, match="cannot be read"):
        list(import_entries(other, tmp_path / "x.tar"))


def test_entries_before_the_damage_are_kept(store: Store, other: Store, make: Make, tmp_path: Path) -> None:
    keys = sorted(make(store, n=n).key for n in range(3))
    export_entries(store, keys, tmp_path / "x.tar")
    data = (tmp_path / "x.tar").read_bytes()
    (tmp_path / "x.tar").write_bytes(data[: data.index(keys[2].encode()) + 700])
    with pytest.raises(DamagedArchive):
        list(import_entries(other, tmp_path / "x.tar"))
    assert [entry.key for entry in other.entries()] == keys[:2]
    assert list(other.layout.drafts.iterdir()) == []
