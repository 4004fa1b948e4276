"""Leases, claims and cleaning in an object store: what is alive stays, and what is dead goes."""

import threading
from collections.abc import Callable

import pytest

from semidense.cache import CacheUnavailable, Entry, Recipe, Store
from semidense.cache.objects import leases, living, names
from semidense.cache.objects.living import take
from semidense.cache.objects.requests import Objects, connect
from semidense.cache.upkeep import objects_gc
from semidense.cache.upkeep.gc import collect, survey
from semidense.cache.upkeep.limits import Limits

Make = Callable[..., Entry]
ALL = Limits(seconds=-1)
"""Every entry that nobody uses may go."""


def objects_of(store: Store) -> Objects:
    return connect(str(store.root))


def later(monkeypatch: pytest.MonkeyPatch, seconds: float) -> None:
    """Let the store's clock go on; what is there was written before."""
    real = Objects.now
    monkeypatch.setattr(Objects, "now", lambda self: real(self) + seconds)


def kinds(store: Store, limits: Limits = Limits()) -> list[str]:  # noqa: B008
    return [item.kind for item in survey(store, limits).items]


def test_an_entry_that_nobody_uses_goes_with_its_data(objects_store: Store, make: Make) -> None:
    entry = make(objects_store)
    found = survey(objects_store, ALL).items
    assert [(item.kind, item.name) for item in found] == [("entry", entry.key)]
    assert collect(objects_store, found) == found
    assert objects_store.find(entry.key) is None
    assert {each.path.partition("/")[0] for each in objects_of(objects_store).below("")} == {names.TAG}
    assert make(objects_store).digest == entry.digest


def test_a_cleaning_with_nothing_to_delete_writes_nothing(
    objects_store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its mark in a prefix without a tag would make whoever creates the cache meanwhile take it for foreign."""
    found, put = survey(objects_store, ALL).items, Objects._put

    def refuse(*arguments: object) -> None:
        raise AssertionError(f"wrote {arguments[1]}")

    monkeypatch.setattr(Objects, "_put", refuse)
    assert collect(objects_store, found) == found == ()
    monkeypatch.setattr(Objects, "_put", put)
    assert [each.path for each in objects_of(objects_store).below("")] == []


def test_somebody_elses_objects_are_not_cleaned_away(objects_store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    place = f"data/{'0' * 32}/{'1' * 64}"
    objects_of(objects_store).put(f"{place}/holiday.jpg", b"beach")
    later(monkeypatch, objects_gc.ORPHAN_SECONDS + 1)
    for refused in (lambda: survey(objects_store, ALL), lambda: collect(objects_store, ())):
        with pytest.raises(CacheUnavailable, match="is not a cache: it holds 'data'"):
            refused()
    assert [each.path for each in objects_of(objects_store).below("")] == [f"{place}/holiday.jpg"]


def test_what_a_living_run_uses_stays(memory: Store, make: Make) -> None:
    entry = make(memory)
    found = survey(memory, ALL)
    with memory.lease() as lease:
        lease.add([entry.key])
        assert survey(memory, ALL).used == 1
        assert collect(memory, found.items) == (), "it was taken into use after the survey"
    assert memory.require(entry.key) == entry
    assert kinds(memory, ALL) == ["entry"]


def test_a_run_waits_for_a_cleaning_that_is_about_to_delete_what_it_wants(memory: Store, make: Make) -> None:
    entry = make(memory)
    found = survey(memory, ALL).items
    cleaning = take(objects_of(memory), names.CLEANING, {"keys": [entry.key]})
    assert cleaning is not None
    with memory.lease() as lease:
        adding = threading.Thread(target=lambda: lease.add([entry.key]))
        adding.start()
        adding.join(0.3)
        assert adding.is_alive()
        with pytest.raises(CacheUnavailable, match="somebody else is cleaning"):
            collect(memory, found)
        cleaning.release()
        adding.join(10)
        assert not adding.is_alive()


def test_a_run_does_not_wait_for_a_cleaning_that_died(
    memory: Store, make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = make(memory)
    assert take(objects_of(memory), names.CLEANING, {"keys": [entry.key]})
    later(monkeypatch, living.EXPIRY + 1)
    with memory.lease() as lease:
        monkeypatch.setattr(lease.__class__, "is_seen", lambda _: True)
        lease.add([entry.key])
    assert collect(memory, ()) == (), "the next one takes its place"


def test_a_claim_of_a_dead_process_is_taken_over(
    memory: Store, recipe: Recipe, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory.backend.create()
    dead = memory.claim(recipe.key)
    assert dead is not None
    assert memory.claim(recipe.key) is None
    later(monkeypatch, living.EXPIRY + 1)
    assert kinds(memory) == ["stale lock"]
    taken = memory.claim(recipe.key)
    assert taken is not None
    dead.release()
    assert memory.claimant(recipe.key), "who comes back from the dead does not release another's claim"
    taken.release()
    assert memory.claimant(recipe.key) is None


def test_a_sign_of_life_keeps_a_claim(memory: Store, recipe: Recipe, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(living, "BEAT", 0.05)
    monkeypatch.setattr(living, "_hearts", living._Hearts())
    claim = memory.claim(recipe.key)
    first = objects_of(memory).get(f"claims/{recipe.key}")
    threading.Event().wait(0.5)
    second = objects_of(memory).get(f"claims/{recipe.key}")
    assert first and second and claim
    assert second.version != first.version
    claim.release()


def test_a_draft_of_a_dead_run_goes_and_a_living_ones_stays(
    memory: Store, recipe: Recipe, filled: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    filled(memory.begin(recipe, {}))
    assert kinds(memory) == []
    later(monkeypatch, living.EXPIRY + 1)
    found = survey(memory, Limits()).items
    assert [(item.kind, item.reason) for item in found] == [
        ("draft", "its run is gone"),
        ("stale lock", "its process is gone"),
    ]
    assert collect(memory, found) == found
    assert list(objects_of(memory).below("leases")) == []
    assert kinds(memory) == [], "what stands in place of the manifest stays for a day: a writer may be late"
    later(monkeypatch, objects_gc.ORPHAN_SECONDS + 1)
    found = survey(memory, Limits()).items
    assert {item.kind for item in found} == {"orphan"}
    collect(memory, found)
    assert list(objects_of(memory).below("data")) == []


def test_a_run_whose_lease_was_taken_for_dead_is_told(memory: Store, make: Make) -> None:
    entry = make(memory)
    with memory.lease() as lease:
        objects_of(memory).delete([leases.alive(str(lease.name))])
        with pytest.raises(CacheUnavailable, match="run again: what was made before is kept"):
            lease.add([entry.key])


def test_last_use_is_when_a_run_last_named_an_entry(memory: Store, make: Make) -> None:
    old, new = make(memory), make(memory, n=4)
    threading.Event().wait(0.05)
    with memory.lease() as lease:
        lease.add([old.key])
    used = memory.last_used()
    assert used(old.key) > used(new.key) > used("0" * 64) == 0
    (first, *_) = survey(memory, Limits(bytes=old.size)).items
    assert first.name == new.key, "the one unused for longest goes first"


def test_quarantine_and_damaged_records_go(memory: Store, make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIPELINE_NEAR_BYTES", "0")
    one, two = make(memory), make(memory, n=4)
    objects_of(memory).put(names.record(one.key), b"{}")
    for each in list(objects_of(memory).below("data")):
        if "/c/" in each.path:
            objects_of(memory).put(each.path, b"x")
    memory.backend.set_aside(two.key, "full")
    found = survey(memory, Limits()).items
    assert sorted(item.kind for item in found) == ["damaged record", "quarantine"]
    collect(memory, found)
    assert list(objects_of(memory).below("records")) == []


def test_what_a_run_that_came_back_to_life_is_making_stays(
    memory: Store, recipe: Recipe, filled: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    draft = memory.begin(recipe, {})
    filled(draft)
    with monkeypatch.context() as patch:
        later(patch, living.EXPIRY + 1)
        found = survey(memory, Limits()).items
    assert len(found) == 2
    assert collect(memory, found) == ()
    assert draft.publish(1.5, {}) == memory.find(recipe.key)


def test_an_entry_that_was_made_again_since_the_survey_stays(memory: Store, make: Make) -> None:
    entry = make(memory)
    sound = objects_of(memory).get(names.record(entry.key))
    objects_of(memory).put(names.record(entry.key), b"{}")
    found = survey(memory, Limits()).items
    assert [item.kind for item in found] == ["damaged record"]
    assert sound
    objects_of(memory).put(names.record(entry.key), sound.data)
    assert collect(memory, found) == ()
    assert memory.require(entry.key) == entry


def test_a_run_waits_while_a_damaged_record_that_it_will_replace_is_deleted(memory: Store, make: Make) -> None:
    entry = make(memory)
    objects_of(memory).put(names.record(entry.key), b"{}")
    found = survey(memory, Limits()).items
    with memory.lease() as lease:
        lease.add([entry.key])
        assert collect(memory, found) == (), "the run is about to replace it"


def test_a_try_of_the_store_that_was_killed_goes_after_a_day(
    memory: Store, make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    make(memory)
    objects_of(memory).put("probe/1f", b"")
    assert kinds(memory) == []
    later(monkeypatch, objects_gc.ORPHAN_SECONDS + 1)
    found = survey(memory, Limits()).items
    assert [item.name for item in found] == ["probe/1f"]
    collect(memory, found)
    assert list(objects_of(memory).below("probe")) == []
