import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from semidense.cache import DamagedEntry, Entry, Recipe, Store
from semidense.cache.entries.check import SETTLED, _hashed
from semidense.cache.files import walk
from tests.faults.damage import DAMAGE, Damage, chunk, files_of, flips, overwrite, unlock


def test_a_flipped_bit_at_every_offset_is_found(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    make(store)
    trials = 0
    for name, path in files_of(store, recipe.key).items():
        for offset in flips(path):
            assert store.check(recipe.key) is not None, f"{name} at {offset}"
            trials += 1
        assert store.check(recipe.key) is None
    assert trials > 2000


def test_a_flipped_bit_in_a_chunk_never_reads_as_another_value_even_unchecked(
    store: Store, make: Callable[..., Entry], recipe: Recipe, values: np.ndarray
) -> None:
    make(store)
    unchecked = Store(store.root, "size")
    path = store.layout.entry(recipe.key) / "data.zarr/map/c/0/0"
    good = path.read_bytes()
    refused = 0
    for offset in range(len(good)):
        bad = bytearray(good)
        bad[offset] ^= 1 << offset % 8
        overwrite(path, bytes(bad))
        try:
            read = unchecked.open(recipe.key)["map"].values
        except Exception:  # noqa: BLE001 - whatever the codec says, it is an error
            refused += 1
        else:
            np.testing.assert_array_equal(read, values)
    assert refused > len(good) // 2


@pytest.mark.parametrize("damage", [pytest.param(each, id=name) for name, each in DAMAGE.items()])
def test_damage_is_found_set_aside_and_made_again(
    store: Store,
    make: Callable[..., Entry],
    recipe: Recipe,
    damage: Damage,
    caplog: pytest.LogCaptureFixture,
) -> None:
    first = make(store)
    store = Store(store.root, "size")  # all that this finds, the full check finds: it begins the same way
    assert store.require(recipe.key) == first
    unlock(store, recipe.key)
    damage(store.layout.entry(recipe.key), store.layout.record(recipe.key))
    before = sorted(path for path, _ in walk(store.root))
    said = store.check(recipe.key)
    assert said is not None
    assert "\n" not in said
    assert sorted(path for path, _ in walk(store.root)) == before  # looking changes nothing
    with pytest.raises(DamagedEntry, match=r"^[^\n]+$"):
        store.require(recipe.key)
    assert len(caplog.records) == 1
    assert store.find(recipe.key) is None
    assert len(list(store.layout.quarantine.iterdir())) == 1
    assert make(store).digest == first.digest
    assert store.require(recipe.key).digest == first.digest


def test_same_sized_damage_is_found_by_the_full_check(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    make(store)
    path = chunk(store.layout.entry(recipe.key))
    overwrite(path, bytes(path.stat().st_size))
    assert Store(store.root, "size").check(recipe.key) is None
    assert "are not those that were written" in str(store.check(recipe.key))


def test_an_entry_copied_under_another_key(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    make(store)
    other = make(store, n=4)
    for path in (store.layout.record, store.layout.entry):
        path(other.key).rename(store.root / "old")
        (shutil.copytree if path(recipe.key).is_dir() else shutil.copy)(path(recipe.key), path(other.key))
        shutil.rmtree(store.root / "old", ignore_errors=True)
        (store.root / "old").unlink(missing_ok=True)
    assert "is the record of" in str(store.check(other.key))
    assert store.check(recipe.key) is None
    assert [entry.key for entry in store.entries()] == [recipe.key]


def test_data_copied_under_another_key(
    store: Store, make: Callable[..., Entry], recipe: Recipe, values: np.ndarray
) -> None:
    make(store)
    other = make(store, values + 1, n=4)
    shutil.rmtree(store.layout.entry(other.key))
    shutil.copytree(store.layout.entry(recipe.key), store.layout.entry(other.key))
    assert "its manifest has digest" in str(store.check(other.key))


@pytest.fixture
def hashes(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The files that were hashed."""
    from semidense.cache.entries import check

    done: list[Path] = []

    def hash_file(path: Path, real: Callable[[Path], str] = check.hash_file) -> str:
        done.append(path)
        return real(path)

    monkeypatch.setattr(check, "hash_file", hash_file)
    _hashed.clear()
    return done


def _age(store: Store, key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the files' times be long enough ago."""
    import time

    now = time.time()
    monkeypatch.setattr("semidense.cache.entries.check.time.time", lambda: now + 2 * SETTLED)


def test_unchanged_files_are_read_once_a_process(
    store: Store, make: Callable[..., Entry], recipe: Recipe, hashes: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    make(store)
    _age(store, recipe.key, monkeypatch)
    store.require(recipe.key)
    assert len(hashes) == 4
    Store(store.root).require(recipe.key)
    assert len(hashes) == 4


def test_a_changed_file_is_read_again_though_its_times_are_put_back(
    store: Store, make: Callable[..., Entry], recipe: Recipe, hashes: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    make(store)
    _age(store, recipe.key, monkeypatch)
    store.require(recipe.key)
    path = chunk(store.layout.entry(recipe.key))
    times = path.stat().st_mtime_ns
    overwrite(path, bytes(path.stat().st_size))
    os.utime(path, ns=(times, times))
    assert "are not those" in str(store.check(recipe.key))


def test_a_file_of_just_now_is_not_remembered(
    store: Store, make: Callable[..., Entry], recipe: Recipe, hashes: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    make(store)
    files = (path for path in store.layout.entry(recipe.key).rglob("*") if path.is_file())
    first = min(path.stat().st_ctime for path in files)
    monkeypatch.setattr("semidense.cache.entries.check.time.time", lambda: first)
    store.require(recipe.key)
    assert len(hashes) == 4
    store.require(recipe.key)
    assert len(hashes) == 8
