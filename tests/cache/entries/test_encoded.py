"""Small results of one writer are written and synced together; each is as whole and as safe as from a draft."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from semidense.cache import (
    Encoded,
    Entry,
    InvalidArray,
    InvalidRecipe,
    NonDeterministicStage,
    Recipe,
    Store,
    Values,
    encode,
)
from semidense.cache.entries import publish
from semidense.cache.entries.publish import STEPS
from semidense.cache.files import walk

Run = Callable[..., str]
Make = Callable[..., Entry]
PARTS = [step for step in STEPS if step not in ("array created", "complete", "hashed")]
"""The steps that results go through: their files are known before anything is written."""


def recipe_of(number: int) -> Recipe:
    return Recipe("square", {"squares": "1f"}, {"n": number}, {"images": "ab"}, {"zarr": "3"})


def result_of(number: int, values: np.ndarray) -> Encoded:
    return encode(
        recipe_of(number), {"scene": "Teddy"}, {"map": Values(values, (2, 3), ("y", "x"), {"units": "px"})}, 1.5, {}
    )


def publish_all(store: Store, *results: Encoded) -> list[Entry]:
    with store.lease() as lease:
        return store.publish_all(results, lease)


@pytest.mark.parametrize("dtype", ["float32", "float16", "int32", "bool"])
@pytest.mark.parametrize("chunks", [(2, 3), (3, 3), (1, 1), (8, 8)])
def test_a_result_has_the_very_files_of_a_draft(
    store: Store, tmp_path: Path, values: np.ndarray, dtype: str, chunks: tuple[int, int]
) -> None:
    array = np.nan_to_num(values).astype(dtype)
    extra = np.arange(3)
    result = encode(
        recipe_of(1),
        {"scene": "Teddy"},
        {"map": Values(array, chunks, ("y", "x"), {"units": "px"}), "x": Values(extra, (3,), ("x",), {})},
        1.5,
        {"by": "test"},
    )
    (entry,) = publish_all(store, result)
    other = Store(tmp_path / "other")
    with other.begin(recipe_of(1), {"scene": "Teddy"}) as draft:
        draft.create_array("map", array.shape, dtype, chunks, ("y", "x"), {"units": "px"})
        for first in range(0, 3, chunks[0]):
            rows = slice(first, min(3, first + chunks[0]))
            draft.write("map", (rows, slice(0, 3)), array[rows])
        draft.create_array("x", (3,), str(extra.dtype), (3,), ("x",), {})
        draft.write("x", (slice(0, 3),), extra)
        drafted = draft.publish(1.5, {"by": "test"})
    assert entry.digest == result.digest == drafted.digest
    assert entry.provenance() | {"created": ""} == drafted.provenance() | {"created": ""}
    folders = [each.layout.entry(entry.key) for each in (store, other)]
    found = [
        {
            path: (thing.stat().st_mode, thing.is_file() and Path(thing.path).read_bytes())
            for path, thing in walk(folder)
        }
        for folder in folders
    ]
    assert found[0] == found[1]
    assert folders[0].stat().st_mode == folders[1].stat().st_mode
    assert store.layout.record(entry.key).stat().st_mode == other.layout.record(entry.key).stat().st_mode


def test_all_of_all_entries_is_on_disk_before_the_first_record_is_linked(
    store: Store, values: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int] = []
    before: list[set[int]] = []
    real = os.fsync

    def note(handle: int) -> None:
        real(handle)
        synced.append(os.fstat(handle).st_ino)

    def hook(step: str) -> None:
        if step in ("entry synced", "record linked"):
            before.append({*synced})

    monkeypatch.setattr("os.fsync", note)
    monkeypatch.setattr(publish, "STEP_HOOK", hook)
    entries = publish_all(store, *(result_of(number, values) for number in range(3)))
    assert len(before) == 4
    assert len({frozenset(each) for each in before}) == 1, "they are synced once, before any record"
    needed: list[Path] = []
    for entry in entries:
        folder, record = store.layout.entry(entry.key), store.layout.record(entry.key)
        needed += [
            *(folder / path for path, _ in walk(folder)),
            folder,
            *folder.parents[:2],
            record,
            record.parent.parent,
        ]
        assert record.parent.stat().st_ino in synced, "so is the name that makes it exist, in the end"
    assert {path.stat().st_ino for path in needed} <= before[0]
    shared = store.layout.entries.stat().st_ino
    assert synced.count(shared) == 1, "a folder that they share is synced once"


KILLS = """
import zarr.codecs  # before the forks, once for all
from semidense.cache import Values, encode
base, once = Path(sys.argv[1]), ("locked", "entry synced", "published")

def result(number):
    recipe = Recipe("square", {"squares": "1f"}, {"n": number}, {"images": "ab"}, {"zarr": "3"})
    return encode(recipe, {"scene": "Teddy"}, {"map": Values(values, (2, 3), ("y", "x"), {"units": "px"})}, 1.5, {})

for number, step in enumerate(sys.argv[2].split(",")):
    store = Store(base / str(number))
    def work():
        seen = []
        def hook(done):
            seen.append(done)
            if done == step and seen.count(step) == (1 if step in once else 2):
                die()
        publish.STEP_HOOK = hook
        with store.lease() as lease:
            store.publish_all([result(n) for n in range(3)], lease)
    assert code(in_child(work)) == -signal.SIGKILL, step
print("done")
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory, run_script: Run) -> Path:
    base = tmp_path_factory.mktemp("killed")
    assert run_script(KILLS, base, ",".join(PARTS)) == "done\n"
    return base


@pytest.mark.parametrize("step", PARTS)
def test_a_kill_at_the_second_result_leaves_whole_entries_or_nothing_visible(
    killed: Path, values: np.ndarray, step: str
) -> None:
    store = Store(killed / str(PARTS.index(step)))
    there = [entry.key for entry in store.entries()]
    linked = {"record linked": 2, "published": 3}
    assert len(there) == linked.get(step, 0)
    assert [store.check(key) for key in there] == [None] * len(there)
    again = publish_all(store, *(result_of(number, values) for number in range(3)))
    for entry in again:
        assert store.check(entry.key) is None
        np.testing.assert_array_equal(store.read(entry.key)["map"], values)
    store.sweep_drafts()
    folders = (store.layout.drafts, store.layout.quarantine, store.layout.locks, store.layout.leases)
    assert [list(folder.iterdir()) for folder in folders] == [[], [], [], []]


def test_results_that_are_there_are_dropped_and_others_published(store: Store, values: np.ndarray) -> None:
    (first,) = publish_all(store, result_of(1, values))
    entries = publish_all(store, *(result_of(number, values) for number in range(3)))
    assert entries[1] == first
    assert [entry.recipe.params["n"] for entry in entries] == [0, 1, 2]
    assert list(store.layout.drafts.iterdir()) == []


def test_of_results_one_of_which_differs_none_is_placed(store: Store, values: np.ndarray) -> None:
    (first,) = publish_all(store, result_of(1, values))
    with pytest.raises(NonDeterministicStage, match=first.digest):
        publish_all(store, result_of(0, values), result_of(1, values + 1))
    assert list(store.entries()) == [first]
    assert list(store.layout.entry_keys()) == [first.key]
    assert list(store.layout.drafts.iterdir()) == []


CROWD = """
import zarr.codecs
from semidense.cache import Values, encode
store = Store(Path(sys.argv[1]))
def work(numbers):
    for turn in range(8):
        with store.lease() as lease:
            store.publish_all([
                encode(Recipe("square", {"squares": "1f"}, {"n": 10 * turn + n}, {"images": "ab"}, {"zarr": "3"}),
                       {"scene": "Teddy"}, {"map": Values(values, (2, 3), ("y", "x"), {})}, 1.5, {})
                for n in numbers], lease)
children = [in_child(lambda: work(numbers)) for numbers in ([0, 1, 2], [2, 1, 0], [1, 0], [2, 0])]
print([code(child) for child in children], len(list(store.entries())))
"""


def test_writers_of_the_same_keys_in_other_orders_do_not_wait_for_each_other(tmp_path: Path, run_script: Run) -> None:
    assert run_script(CROWD, tmp_path / "cache") == "[0, 0, 0, 0] 24\n"


def test_a_result_whose_run_was_ended_does_not_come_back(
    store: Store, values: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    with store.lease() as lease:

        def end(step: str) -> None:
            if step == "begun":
                lease.discard_drafts()

        monkeypatch.setattr(publish, "STEP_HOOK", end)
        with pytest.raises(Exception, match="No such file"):
            store.publish_all([result_of(1, values)], lease)
    assert list(store.layout.drafts.iterdir()) == []
    assert list(store.entries()) == []


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("map", np.zeros((3, 3), "complex64"), "cannot be stored"),
        ("a b", np.zeros((3, 3)), "the name is taken, or not made of"),
        ("map", np.zeros(3), "must have one item a dimension"),
    ],
)
def test_an_array_that_a_draft_would_refuse_is_refused(name: str, array: np.ndarray, message: str) -> None:
    with pytest.raises(InvalidArray, match=message):
        encode(recipe_of(1), {}, {name: Values(array, (2, 3), ("y", "x"), {})}, 1.5, {})


def test_a_label_that_is_no_text_is_refused(values: np.ndarray) -> None:
    with pytest.raises(InvalidRecipe, match="label"):
        encode(recipe_of(1), {"scene": 1}, {"map": Values(values, (2, 3), ("y", "x"), {})}, 1.5, {})  # type: ignore[dict-item]
