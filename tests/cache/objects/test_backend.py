"""What every backend promises, tried on all three: a folder, the memory of this process, a real S3 server."""

import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from semidense.cache import (
    CacheUnavailable,
    DamagedEntry,
    Entry,
    EntryNotFound,
    IncompleteDraft,
    InvalidArray,
    NonDeterministicStage,
    Recipe,
    Store,
)
from semidense.cache.entries.entry import Manifest
from semidense.cache.objects import names, records
from semidense.cache.objects.requests import Objects, connect
from semidense.cache.upkeep.verify import size, verify

Make = Callable[..., Entry]
DIGEST = "fa3e99da3abd5a617b2159e8a036629ff4075ea27c01bbabf54769112ed4b158"
"""Of the small result of ``conftest.fill``: the same wherever it is kept."""


@pytest.fixture(params=["store", "memory", "s3"])
def place(request: pytest.FixtureRequest) -> Store:
    store: Store = request.getfixturevalue(request.param)
    return store


def objects_of(store: Store) -> Objects:
    return connect(str(store.root))


def damage(store: Store, key: str, name: str, data: bytes | None) -> None:
    """Replace or delete a file of an entry behind the cache's back."""
    path = f"data/{records.read(objects_of(store), key).place}/{name}"
    if data is None:
        objects_of(store).delete([path])
    else:
        objects_of(store).put(path, data)


def test_an_entry_comes_back_as_it_was_written_with_the_same_digest_everywhere(
    place: Store, make: Make, values: np.ndarray
) -> None:
    entry = make(place)
    assert entry.digest == DIGEST
    assert place.find(entry.key) == entry == place.require(entry.key)
    assert place.check(entry.key) is None
    np.testing.assert_array_equal(place.read(entry.key)["map"], values)
    opened = place.open(entry.key)
    np.testing.assert_array_equal(opened["map"][2:].values, values[2:])
    assert opened.attrs["digest"] == DIGEST
    assert [each.key for each in place.entries()] == [entry.key]
    assert verify(place).sound == (entry.key,)
    assert size(place).stages == {"square": entry.size}


def test_a_missing_entry_is_told(place: Store, recipe: Recipe) -> None:
    assert place.find(recipe.key) is None
    with pytest.raises(EntryNotFound, match=recipe.key):
        place.require(recipe.key)
    assert list(place.entries()) == []


def test_nobody_sees_a_draft_and_one_that_fails_leaves_nothing(
    place: Store, recipe: Recipe, filled: Callable[..., None]
) -> None:
    with pytest.raises(RuntimeError, match="halfway"), place.begin(recipe, {}) as draft:
        filled(draft)
        assert place.find(recipe.key) is None
        assert draft.exists()
        raise RuntimeError("halfway")
    assert not draft.exists()
    assert draft.published() is None
    assert (size(place).drafts, size(place).stages) == (0, {})
    with pytest.raises(InvalidArray, match="gone"):
        draft.write("map", (slice(0, 2), slice(0, 3)), np.zeros((2, 3), np.float32))


def test_a_draft_that_lacks_a_chunk_is_not_published(
    place: Store, recipe: Recipe, filled: Callable[..., None], values: np.ndarray
) -> None:
    draft = place.begin(recipe, {})
    draft.create_array("map", (3, 3), "float32", (2, 3), ("y", "x"), {}, fill_value=0)
    draft.write("map", (slice(0, 2), slice(0, 3)), values[:2])
    assert draft.holds("map", (slice(0, 2), slice(0, 3)))
    assert not draft.holds("map", (slice(2, 3), slice(0, 3)))
    assert not draft.holds("other")
    with pytest.raises(IncompleteDraft, match=r"lacks 1 of 4 files, first data\.zarr/map/c/1/0"):
        draft.publish(1, {})
    assert place.find(recipe.key) is None


def test_a_second_writer_gets_the_first_ones_entry(place: Store, make: Make) -> None:
    first = make(place)
    before = size(place).total
    assert make(place) == first
    assert size(place).total == before, "the second copy is gone"


def test_a_second_result_of_one_recipe_is_refused(place: Store, make: Make, values: np.ndarray) -> None:
    first = make(place)
    with pytest.raises(NonDeterministicStage, match="two results from one recipe"):
        make(place, values + 1)
    assert place.require(first.key) == first
    assert verify(place).sound == (first.key,)


def test_of_many_writers_one_wins_and_all_agree(place: Store, make: Make) -> None:
    found: list[Entry] = []
    writers = [threading.Thread(target=lambda: found.append(make(place))) for _ in range(4)]
    for each in writers:
        each.start()
    for each in writers:
        each.join()
    assert len(found) == 4
    assert len(set(map(repr, found))) == 1
    assert (size(place).drafts, size(place).orphans) == (0, 0)


def test_another_process_of_the_run_finds_the_draft_and_what_it_became(
    place: Store, recipe: Recipe, filled: Callable[..., None]
) -> None:
    with place.lease() as lease:
        assert lease.is_seen()
        mine, other = (place.begin(recipe, {}, lease, "step") for _ in range(2))
        filled(mine)
        assert other.holds("map")
        entry = mine.publish(1.5, {})
        assert other.published() == entry
        late = place.begin(replace(recipe, params={"n": 4}), {}, lease, "step")
        filled(late)
        lease.discard_drafts()
        assert not late.exists()
    assert not lease.is_seen()
    assert place.require(entry.key) == entry, "what was published stays"


def test_a_claim_has_one_holder(place: Store, recipe: Recipe) -> None:
    claim = place.claim(recipe.key)
    assert claim is not None
    assert place.claim(recipe.key) is None
    assert str(place.claimant(recipe.key)).startswith("process ")
    claim.release()
    again = place.claim(recipe.key)
    assert again is not None
    again.release()


def test_a_checkpoint_is_replaced_as_a_whole(place: Store, recipe: Recipe) -> None:
    place.backend.create()
    kept = place.checkpoint(recipe.key)
    assert kept.load() is None
    kept.save(b"one")
    kept.save(b"two")
    assert place.checkpoint(recipe.key).load() == b"two"
    kept.remove()
    assert kept.load() is None


def test_sources_are_kept_by_the_hash_of_their_code(place: Store) -> None:
    from semidense.cache import code_parts

    code = code_parts("semidense.cache.owner", ("semidense",))
    place.keep_sources(code)
    assert 'def owner() -> str:\n    """Return the name' in str(place.kept_source(code["semidense.cache.owner"]))
    assert place.kept_source("0" * 64) is None


@pytest.mark.parametrize("name", ["data.zarr/map/c/0/0", "data.zarr/map/zarr.json", "manifest.json"])
@pytest.mark.parametrize("data", [None, b"", b"other bytes"])
def test_no_damage_is_read_and_the_entry_is_made_again(
    memory: Store, make: Make, values: np.ndarray, monkeypatch: pytest.MonkeyPatch, name: str, data: bytes | None
) -> None:
    monkeypatch.setenv("PIPELINE_NEAR_BYTES", "0")
    entry = make(memory)
    damage(memory, entry.key, name, data)
    assert list(verify(memory).damaged) == [entry.key]
    with pytest.raises(DamagedEntry):
        memory.read(entry.key)
    assert memory.find(entry.key) is None, "it was set aside"
    assert [*verify(memory).quarantined] == [entry.key]
    assert make(memory).digest == entry.digest
    np.testing.assert_array_equal(memory.read(entry.key)["map"], values)
    assert verify(memory).damaged == {}


def test_every_flipped_byte_of_a_record_is_noticed(memory: Store, make: Make) -> None:
    entry = make(memory)
    path = names.record(entry.key)
    found = objects_of(memory).get(path)
    assert found is not None
    for at in range(0, len(found.data), 7):
        objects_of(memory).put(path, found.data[:at] + bytes([found.data[at] ^ 1]) + found.data[at + 1 :])
        assert memory.find(entry.key) is None
    assert make(memory).digest == entry.digest, "a damaged record makes way"


def test_a_record_whose_data_are_gone_makes_way(memory: Store, make: Make) -> None:
    entry = make(memory)
    place = records.read(objects_of(memory), entry.key).place
    objects_of(memory).delete(each.path for each in objects_of(memory).below(f"data/{place}"))
    again = make(memory)
    assert again.digest == entry.digest
    assert records.read(objects_of(memory), entry.key).place != place


def test_a_draft_that_was_given_up_is_never_published(
    memory: Store, recipe: Recipe, filled: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    draft = memory.begin(recipe, {})
    filled(draft)
    sealed = Manifest.to_bytes

    def given_up_just_before(manifest: Manifest) -> bytes:
        draft.discard()
        return sealed(manifest)

    monkeypatch.setattr(Manifest, "to_bytes", given_up_just_before)
    with pytest.raises(IncompleteDraft, match="given up"):
        draft.publish(1, {})
    assert memory.find(recipe.key) is None


def test_a_prefix_of_somebody_else_is_refused(memory: Store, make: Make) -> None:
    objects_of(memory).put("holiday.jpg", b"beach")
    with pytest.raises(CacheUnavailable, match=r"is not a cache: it holds 'holiday.jpg' but no CACHE.TAG"):
        make(memory)
    assert [each.path for each in objects_of(memory).below("")] == ["holiday.jpg"]


def test_a_publisher_killed_before_its_record_leaves_nothing_that_is_seen(
    memory: Store, recipe: Recipe, filled: Callable[..., None], make: Make
) -> None:
    with memory.lease() as lease:
        draft = memory.begin(recipe, {}, lease, "step")
        filled(draft)
        draft._decide(draft._manifest().to_bytes())  # type: ignore[attr-defined]
        assert memory.find(recipe.key) is None
        assert draft.published() is None
        entry = memory.begin(recipe, {}, lease, "step").publish(1.5, {})
        assert entry.digest == DIGEST, "another worker of the run ends what it began"
    other = make(memory, n=4)
    assert verify(memory).sound == tuple(sorted((entry.key, other.key)))
    assert (size(memory).drafts, size(memory).orphans) == (0, 0)
