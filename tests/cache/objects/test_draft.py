"""Drafts in an object store: what one says does not depend on lists, and what was given up stays given up."""

from collections.abc import Callable
from itertools import islice

import numpy as np
import pytest

from semidense.cache import (
    Encoded,
    IncompleteDraft,
    InvalidArray,
    NonDeterministicStage,
    Recipe,
    Store,
    Values,
    encode,
)
from semidense.cache.objects.requests import Listed, Objects, connect
from tests.s3 import Faults, pointed_at, proxy

Filled = Callable[..., None]


def test_a_list_that_comes_late_leaves_no_array_out(s3_port: int, recipe: Recipe, filled: Filled) -> None:
    faults = Faults(late=60.0)
    with proxy(s3_port, faults) as port, pointed_at(port) as url:
        store = Store(url)
        draft = store.begin(recipe, {})
        filled(draft)
        draft.create_array("level", (1,), "int32", (1,), ("one",), {})
        draft.write("level", (slice(0, 1),), np.array([7], np.int32))
        assert connect(url).names(f"data/{draft.place}/data.zarr") == [], "the list lacks objects"  # type: ignore[attr-defined]
        draft.publish(1.5, {})
        assert sorted(store.read(recipe.key)) == ["level", "map"]
        assert store.read(recipe.key)["level"].tolist() == [7]


def test_an_array_whose_creator_was_killed_is_created_again_and_else_not_published(
    memory: Store, recipe: Recipe, filled: Filled
) -> None:
    draft = memory.begin(recipe, {})
    filled(draft)
    draft._announce("level")  # type: ignore[attr-defined]
    assert not draft.has_array("level")
    with pytest.raises(IncompleteDraft, match=r"lacks 1 of 5 files, first data.zarr/level/zarr.json"):
        draft.publish(1.5, {})
    draft = memory.begin(recipe, {})
    filled(draft)
    draft._announce("level")  # type: ignore[attr-defined]
    draft.create_array("level", (1,), "int32", (1,), ("one",), {})
    draft.write("level", (slice(0, 1),), np.array([7], np.int32))
    draft.publish(1.5, {})
    assert memory.read(recipe.key)["level"].tolist() == [7]


def test_a_second_attempt_of_a_run_makes_what_the_first_gave_up(memory: Store, recipe: Recipe, filled: Filled) -> None:
    with memory.lease() as lease:
        first = memory.begin(recipe, {}, lease, "step")
        filled(first)
        lease.discard_drafts()
        second, other = (memory.begin(recipe, {}, lease, "step") for _ in range(2))
        assert second == other.__class__(other.recipe, other.label, second.started, other.url, other.place)  # type: ignore[attr-defined,call-arg]
        with pytest.raises(InvalidArray, match="gone"):
            first.write("map", (slice(0, 2), slice(0, 3)), np.zeros((2, 3), np.float32))
        filled(second)
        entry = second.publish(1.5, {})
        assert other.published() == entry == memory.find(recipe.key)


def test_what_a_late_writer_leaves_of_a_draft_that_was_given_up_is_never_published(
    memory: Store, recipe: Recipe, filled: Filled, monkeypatch: pytest.MonkeyPatch
) -> None:
    draft = memory.begin(recipe, {})
    filled(draft)
    real = Objects.below
    with monkeypatch.context() as patch:
        patch.setattr(Objects, "below", lambda self, prefix: islice(real(self, prefix), 1))
        draft.discard()
    assert _below(memory, "data"), "the list was short"
    with pytest.raises(InvalidArray, match="gone"):
        draft.publish(1.5, {})
    assert memory.find(recipe.key) is None


def test_an_object_that_somebody_else_wrote_is_no_chunk(memory: Store, recipe: Recipe, filled: Filled) -> None:
    draft = memory.begin(recipe, {})
    filled(draft)
    connect(str(memory.root)).put(f"data/{draft.place}/data.zarr/map/c/0/0", b"x")  # type: ignore[attr-defined]
    with pytest.raises(IncompleteDraft, match=r"lacks 1 of 4 files, first data.zarr/map/c/0/0"):
        draft.publish(1.5, {})


def _below(store: Store, prefix: str) -> list[Listed]:
    return list(connect(str(store.root)).below(prefix))


def test_results_are_published_together_with_the_digests_of_a_folder(
    objects_store: Store, store: Store, values: np.ndarray
) -> None:
    def result(number: int) -> Encoded:
        recipe = Recipe("square", {"squares": "1f"}, {"n": number}, {"images": "ab"}, {})
        arrays = {"map": Values(values, (2, 3), ("y", "x"), {}), "x": Values(np.arange(3), (3,), ("x",), {})}
        return encode(recipe, {"scene": "Teddy"}, arrays, 1.5, {}, "step")

    results, digests = [result(number) for number in range(4)], list[list[str]]()
    for place in (objects_store, store):
        with place.lease() as lease:
            place.publish_all(results[:2], lease)
            digests.append([entry.digest for entry in place.publish_all(results, lease)])
    assert digests[0] == digests[1] == [each.digest for each in results]
    assert connect(str(objects_store.root)).names("drafts") == []
    np.testing.assert_array_equal(objects_store.read(results[3].recipe.key)["map"], values)


def test_a_result_that_differs_from_what_is_there_is_refused(memory: Store, recipe: Recipe, values: np.ndarray) -> None:
    with memory.lease() as lease:
        first, other = (
            encode(recipe, {}, {"map": Values(each, (3, 3), ("y", "x"), {})}, 1.5, {}) for each in (values, values + 1)
        )
        memory.publish_all([first], lease)
        with pytest.raises(NonDeterministicStage, match=first.digest):
            memory.publish_all([other], lease)
    assert connect(str(memory.root)).names("drafts") == []
