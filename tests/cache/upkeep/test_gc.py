import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from semidense.cache import Entry, Recipe, Store
from semidense.cache.files import walk
from semidense.cache.owner import owner
from semidense.cache.upkeep.gc import FOREIGN_SECONDS, Limits, collect, survey
from tests.faults.damage import DAMAGE, unlock

Make = Callable[..., Entry]
DEAD = f"{owner().rsplit('-', 2)[0]}-4194303-1-00ab"


def names(store: Store, limits: Limits) -> dict[str, str]:
    return {item.name: item.kind for item in survey(store, limits).items}


def age(store: Store, entry: Entry, seconds: float) -> None:
    then = time.time() - seconds
    os.utime(store.layout.record(entry.key), (then, then))


def test_without_limits_no_entry_goes(store: Store, make: Make) -> None:
    make(store)
    assert survey(store, Limits()).items == ()
    assert survey(store, Limits()).kept == 1


def test_looking_changes_nothing(store: Store, make: Make) -> None:
    make(store)
    (store.layout.drafts / DEAD).mkdir()
    before = sorted(path for path, _ in walk(store.root))
    survey(store, Limits(seconds=0))
    assert sorted(path for path, _ in walk(store.root)) == before


@pytest.mark.parametrize(
    ("limits", "going"),
    [
        pytest.param(Limits(seconds=150), "cb", id="unused for long"),
        pytest.param(Limits(seconds=1000), "", id="nothing is so old"),
        pytest.param(Limits(bytes=0), "cba", id="no space at all"),
        pytest.param(Limits(bytes=10**9), "", id="space enough"),
        pytest.param(Limits(keep=frozenset()), "cba", id="nothing is kept"),
        pytest.param(Limits(keep=frozenset("a")), "cb", id="one is kept"),
        pytest.param(Limits(keep=frozenset("c"), seconds=150), "b", id="too old, and not kept"),
        pytest.param(Limits(keep=frozenset("c"), bytes=0), "ba", id="too much, and not kept"),
    ],
)
def test_entries_go_longest_unused_first(store: Store, make: Make, limits: Limits, going: str) -> None:
    entries = {name: make(store, n=n) for n, name in enumerate("abc")}
    for seconds, name in ((100, "a"), (200, "b"), (300, "c")):
        age(store, entries[name], seconds)
    keep = None if limits.keep is None else frozenset(entries[name].key for name in limits.keep)
    limits = Limits(keep, limits.seconds, limits.bytes)
    found = survey(store, limits)
    assert [item.name for item in found.items] == [entries[name].key for name in going]
    assert found.kept == 3 - len(going)
    assert all(item.reason for item in found.items)
    assert len(collect(store, found.items)) == len(going)
    assert {entry.key for entry in store.entries()} == {entries[name].key for name in entries if name not in going}
    assert list(store.layout.drafts.iterdir()) == []


def test_size_stops_as_soon_as_the_rest_fits(store: Store, make: Make) -> None:
    entries = [make(store, n=n) for n in range(3)]
    for number, entry in enumerate(entries):
        age(store, entry, 100 - number)
    total = sum(entry.size for entry in entries)
    assert [item.name for item in survey(store, Limits(bytes=total - 1)).items] == [entries[0].key]


def test_what_a_process_uses_stays(store: Store, make: Make) -> None:
    used, other = make(store), make(store, n=4)
    with store.lease() as lease:
        lease.add([used.key])
        found = survey(store, Limits(seconds=-1))
        assert ([item.name for item in found.items], found.used) == ([other.key], 1)


def test_what_is_used_since_the_survey_stays(store: Store, make: Make) -> None:
    entry = make(store)
    found = survey(store, Limits(seconds=-1))
    with store.lease() as lease:
        lease.add([entry.key])
        assert collect(store, found.items) == ()
    assert store.check(entry.key) is None


@pytest.mark.parametrize(
    ("kind", "leave"),
    [
        ("draft", lambda store, entry: (store.layout.drafts / DEAD).mkdir()),
        ("orphan", lambda store, entry: store.layout.record(entry.key).unlink()),
        ("old format", lambda store, entry: damage(store, entry, "older format")),
        ("damaged record", lambda store, entry: damage(store, entry, "truncated record")),
        ("damaged record", lambda store, entry: damage(store, entry, "record is a pipe")),
        ("damaged record", lambda store, entry: damage(store, entry, "record is a folder")),
        ("quarantine", lambda store, entry: (store.layout.quarantine / "x").mkdir()),
        ("stale lock", lambda store, entry: (store.layout.locks / "x").touch()),
        ("stale lock", lambda store, entry: (store.layout.leases / DEAD).touch()),
        ("checkpoint", lambda store, entry: checkpoint(store, f".{'ab' * 32}.1.2.tmp")),
        ("checkpoint", lambda store, entry: checkpoint(store, entry.key)),
    ],
)
def test_leftovers_are_reclaimed(store: Store, make: Make, kind: str, leave: Callable[[Store, Entry], object]) -> None:
    kept = make(store, n=7)
    leave(store, make(store))
    found = survey(store, Limits())
    assert [item.kind for item in found.items] == [kind]
    assert collect(store, found.items) == found.items
    assert survey(store, Limits()).items == ()
    assert store.check(kept.key) is None
    make(store)
    assert len(list(store.entries())) == 2


def damage(store: Store, entry: Entry, name: str) -> None:
    unlock(store, entry.key)
    DAMAGE[name](store.layout.entry(entry.key), store.layout.record(entry.key))


def checkpoint(store: Store, name: str) -> None:
    store.layout.checkpoints.mkdir()
    (store.layout.checkpoints / name).write_text("x")


def test_what_a_newer_program_wrote_stays(store: Store, make: Make) -> None:
    damage(store, make(store), "newer format")
    assert names(store, Limits(seconds=-1)) == {}


def test_drafts_of_others_stay_for_a_week(store: Store, recipe: Recipe) -> None:
    store.begin(recipe, {})
    foreign = store.layout.drafts / "elsewhere-1-1-00ab"
    foreign.mkdir()
    assert names(store, Limits()) == {}
    then = time.time() - 2 * FOREIGN_SECONDS
    os.utime(foreign, (then, then))
    assert names(store, Limits()) == {foreign.name: "draft"}


def test_a_lock_that_is_held_stays(store: Store, recipe: Recipe) -> None:
    claim = store.claim(recipe.key)
    assert claim
    assert names(store, Limits()) == {}
    claim.release()


def test_data_that_got_a_record_meanwhile_stay(store: Store, make: Make, recipe: Recipe) -> None:
    make(store)
    record = store.layout.record(recipe.key)
    text = record.read_bytes()
    record.unlink()
    found = survey(store, Limits())
    record.write_bytes(text)
    assert collect(store, found.items) == ()
    assert store.check(recipe.key) is None


def test_an_empty_cache_has_nothing_to_clean(tmp_path: Path) -> None:
    assert survey(Store(tmp_path / "none"), Limits(seconds=0)).items == ()
