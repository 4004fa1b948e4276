import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from semidense.cache import CacheUnavailable, Entry, Recipe, Store
from semidense.cache.files import walk
from semidense.cache.upkeep.gc import collect, survey
from semidense.cache.upkeep.limits import Limits
from tests.faults.damage import DAMAGE, unlock

Make = Callable[..., Entry]
LEASE = "0f" * 16
DEAD = f"{LEASE}-{'ab' * 32}"
"""A draft whose lease nobody holds."""


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
        ("quarantine", lambda store, entry: (store.layout.quarantine / f"{'ab' * 32}-00ff00ff").mkdir()),
        ("stale lock", lambda store, entry: (store.layout.locks / f"{'ab' * 32}.making").touch()),
        ("stale lock", lambda store, entry: (store.layout.leases / LEASE).touch()),
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


def test_a_draft_stays_as_long_as_its_lease_is_held_by_whichever_process(store: Store, recipe: Recipe) -> None:
    with store.lease() as lease:
        draft = store.begin(recipe, {}, lease)
        own = store.begin(recipe, {})
        assert names(store, Limits()) == {}
        assert store.sweep_drafts() == 0
    assert names(store, Limits()) == {draft.path.name: "draft"}
    own.discard()
    assert store.sweep_drafts() == 1


def test_only_names_of_the_cache_s_own_form_are_deleted(store: Store, make: Make) -> None:
    make(store)
    mine = [store.root / folder / "mine" for folder in ("drafts", "quarantine", "locks", "leases", "checkpoints")]
    for path in mine:
        path.parent.mkdir(exist_ok=True)
        path.write_text("kept")
    collect(store, survey(store, Limits(seconds=-1)).items)
    store.sweep_drafts()
    assert [path.read_text() for path in mine] == ["kept"] * len(mine)


@pytest.mark.parametrize("folder", ["drafts", "quarantine", "locks", "leases", "checkpoints"])
def test_a_link_in_place_of_a_folder_is_not_followed(store: Store, make: Make, tmp_path: Path, folder: str) -> None:
    make(store)
    outside = tmp_path / "outside"
    outside.mkdir()
    names = ("ab" * 32, f"{'ab' * 32}-00ff00ff", f"{'ab' * 32}.making", LEASE, DEAD)
    for name in names:
        (outside / name).write_text("kept")
    place = store.root / folder
    if place.exists():
        place.rmdir()
    place.symlink_to(outside)
    assert survey(store, Limits()).items == ()
    store.sweep_drafts()
    assert sorted(path.name for path in outside.iterdir()) == sorted(names)
    with pytest.raises(CacheUnavailable, match="it is a link, which the cache does not follow"):
        make(store)


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
