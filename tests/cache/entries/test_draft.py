import os
import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semidense.cache import CacheUnavailable, Draft, Entry, IncompleteDraft, InvalidArray, InvalidRecipe, Recipe, Store
from semidense.cache.entries import publish
from semidense.cache.files import walk


@pytest.fixture
def draft(store: Store, recipe: Recipe) -> Draft:
    return store.begin(recipe, {"scene": "Teddy"})


def test_chunks_are_written_with_a_checksum_even_when_they_are_all_fill_value(
    draft: Draft, filled: Callable[..., None]
) -> None:
    import zarr

    filled(draft)
    array = zarr.open_array(draft.path / "data.zarr" / "map", mode="r")
    assert array.compressors[0].to_dict() == {"name": "zstd", "configuration": {"level": 1, "checksum": True}}
    assert array.shards is None
    assert (draft.path / "data.zarr/map/c/1/0").is_file()


@pytest.mark.parametrize("dtype", ["bool", "int8", "uint16", "int64", "uint64", "float16", "float32", "float64"])
@pytest.mark.parametrize(
    ("shape", "chunks"),
    [
        pytest.param((5, 7), (2, 3), id="chunks that overhang"),
        pytest.param((4,), (9,), id="chunk longer than the array"),
        pytest.param((), (), id="one number"),
        pytest.param((0, 3), (2, 3), id="empty"),
    ],
)
def test_every_type_and_shape_reads_back(
    store: Store, draft: Draft, dtype: str, shape: tuple[int, ...], chunks: tuple[int, ...]
) -> None:
    data = np.asarray(np.arange(np.prod(shape)).reshape(shape) % 2, dtype=dtype)
    draft.create_array("a", shape, dtype, chunks, ("y", "x")[: len(shape)], {})
    draft.write("a", tuple(slice(None) for _ in shape), data)
    read = store.open(draft.publish(0, {}).key)["a"].values
    assert read.dtype == data.dtype
    np.testing.assert_array_equal(read, data)


@pytest.mark.parametrize(
    "region",
    [
        pytest.param((slice(1, 3), slice(0, 6)), id="starts inside a chunk"),
        pytest.param((slice(0, 3), slice(0, 6)), id="ends inside a chunk"),
        pytest.param((slice(0, 2), slice(0, 5)), id="ends inside a chunk of another dimension"),
        pytest.param((slice(0, 6), slice(0, 6)), id="ends beyond the array"),
        pytest.param((slice(-1, None), slice(0, 6)), id="counted from the end"),
        pytest.param((slice(4, 2), slice(0, 6)), id="ends before it starts"),
        pytest.param((slice(0, 4, 2), slice(0, 6)), id="with steps"),
        pytest.param((slice(0, 2),), id="a dimension short"),
    ],
)
def test_misaligned_writes_are_refused(draft: Draft, region: tuple[slice, ...]) -> None:
    draft.create_array("a", (5, 6), "float32", (2, 4), ("y", "x"), {})
    data = np.zeros((5, 6), np.float32)[region if len(region) == 2 else ...]
    with pytest.raises(InvalidArray, match=r"^array 'a' of square: [^\n]+$"):
        draft.write("a", region, data)
    assert not (draft.path / "data.zarr/a/c").exists()


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(np.zeros((2, 6), np.float64), id="another type"),
        pytest.param(np.zeros((2, 6), ">f4"), id="another byte order"),
        pytest.param(np.zeros((2, 5), np.float32), id="another shape"),
        pytest.param(np.zeros((1, 6), np.float32), id="a shape that would broadcast"),
        pytest.param(np.zeros((), np.float32), id="one number"),
    ],
)
def test_other_data_are_refused(draft: Draft, data: np.ndarray) -> None:
    draft.create_array("a", (5, 6), "float32", (2, 4), ("y", "x"), {})
    with pytest.raises(InvalidArray, match="the region takes float32"):
        draft.write("a", (slice(0, 2), slice(0, 6)), data)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        pytest.param({"name": "../a"}, "name", id="a path"),
        pytest.param({"name": ""}, "name", id="empty"),
        pytest.param({"name": "map"}, "name is taken", id="taken"),
        pytest.param({"dtype": "object"}, "cannot be stored", id="objects"),
        pytest.param({"dtype": "U5"}, "cannot be stored", id="text"),
        pytest.param({"dtype": ">f4"}, "cannot be stored", id="foreign byte order"),
        pytest.param({"dtype": "M8[s]"}, "cannot be stored", id="times"),
        pytest.param({"dtype": "nonsense"}, "no NumPy type", id="no type"),
        pytest.param({"chunks": (2,)}, "one item a dimension", id="chunks short"),
        pytest.param({"chunks": (0, 2)}, "must be positive", id="chunk of nothing"),
        pytest.param({"shape": (-1, 3)}, "must not be negative", id="negative"),
        pytest.param({"dims": ("y", "y")}, "one item a dimension", id="a dimension twice"),
        pytest.param({"shape": (4, 3)}, "y has length 4, in another array of the draft 3", id="sizes disagree"),
    ],
)
def test_arrays_that_could_not_be_read_are_refused(
    draft: Draft, filled: Callable[..., None], changed: dict[str, Any], message: str
) -> None:
    filled(draft)
    arguments = {"name": "b", "shape": (3, 3), "dtype": "float32", "chunks": (3, 3), "dims": ("y", "x"), "attrs": {}}
    with pytest.raises(InvalidArray, match=message):
        draft.create_array(**{**arguments, **changed})


def test_attributes_must_be_json(draft: Draft) -> None:
    with pytest.raises(InvalidRecipe, match="nan"):
        draft.create_array("a", (1,), "float32", (1,), ("x",), {"valid_min": float("nan")})


def test_a_missing_chunk_is_refused_and_leaves_nothing(store: Store, draft: Draft) -> None:
    draft.create_array("a", (5,), "float32", (2,), ("x",), {})
    draft.write("a", (slice(0, 2),), np.zeros(2, np.float32))
    with pytest.raises(IncompleteDraft, match=r"square lacks 2 of 5 files, first data.zarr/a/c/1"):
        draft.publish(0, {})
    assert not draft.path.exists()
    assert store.find(draft.recipe.key) is None


def test_an_empty_draft_is_refused(draft: Draft) -> None:
    with pytest.raises(IncompleteDraft, match="no array"):
        draft.publish(0, {})


def test_what_was_published_or_deleted_does_not_come_back(
    store: Store, draft: Draft, filled: Callable[..., None]
) -> None:
    filled(draft)
    draft.publish(0, {})
    for again in (lambda: draft.publish(0, {}), lambda: filled(draft), lambda: draft.write("map", (), np.zeros(()))):
        with pytest.raises(InvalidArray, match="is gone"):
            again()
    assert list(store.layout.drafts.iterdir()) == []


@pytest.mark.filterwarnings("ignore:Object at half_created")
def test_leftovers_of_killed_writers_are_not_published(store: Store, draft: Draft, filled: Callable[..., None]) -> None:
    filled(draft)
    (draft.path / "data.zarr/map/c/0/1.00ff.partial").write_bytes(b"half")
    (draft.path / "data.zarr/half_created/c").mkdir(parents=True)
    (draft.path / "notes").symlink_to("/")
    key = draft.publish(0, {}).key
    assert store.check(key) is None
    assert not [path for path, _ in walk(store.layout.entry(key)) if "partial" in path or "half" in path]


def test_what_another_process_of_the_run_wrote_is_found_again(
    store: Store, recipe: Recipe, filled: Callable[..., None]
) -> None:
    with store.lease() as lease:
        first = store.begin(recipe, {}, lease)
        first.create_array("map", (3, 3), "float32", (2, 3), ("y", "x"), {})
        upper, lower = (slice(0, 2), slice(0, 3)), (slice(2, 3), slice(0, 3))
        first.write("map", upper, np.zeros((2, 3), np.float32))
        again = store.begin(recipe, {}, lease)
        assert again.path == first.path
        assert (again.has_array("map"), again.has_array("other"), again.has_array("../map")) == (True, False, False)
        assert [again.holds("map", region) for region in (upper, lower, None)] == [True, False, False]
        assert not again.holds("other")
        assert again.published() is None
        again.write("map", lower, np.zeros((1, 3), np.float32))
        assert first.holds("map")
        entry = again.publish(1, {})
        assert first.published() == entry
        assert not first.holds("map")


def test_runs_do_not_share_drafts(store: Store, recipe: Recipe) -> None:
    with store.lease() as one, store.lease() as other:
        paths = {store.begin(recipe, {}, lease).path for lease in (one, one, other, None, None)}
        assert len(paths) == 4
        one.discard_drafts()
        assert sum(path.exists() for path in paths) == 3


@pytest.mark.parametrize("step", publish.STEPS[3:])
def test_a_run_whose_publisher_was_killed_publishes_all_the_same(
    store: Store, recipe: Recipe, filled: Callable[..., None], run_script: Callable[..., str], step: str
) -> None:
    """Another process goes on where the first was killed, at whichever step; nothing is made again."""
    with store.lease() as lease:
        draft = store.begin(recipe, {}, lease)
        filled(draft)
        run_script(
            """
from semidense.cache.processes.lease import FolderLease
def work():
    root, path, step = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
    publish.STEP_HOOK = lambda done: die() if done == step else None
    Store(root).begin(recipe, {}, FolderLease(root, path)).publish(1, {})
assert code(in_child(work)) == -signal.SIGKILL
""",
            store.root,
            lease.path,
            step,
        )
        entry = draft.published() or draft.publish(2, {})
        assert (store.check(recipe.key), store.require(recipe.key)) == (None, entry)
        assert draft.published() == entry
        lease.discard_drafts()
        assert list(store.layout.drafts.iterdir()) == []


def killed_once_renamed(
    store: Store, recipe: Recipe, filled: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> Draft:
    """Return a draft whose publisher was killed when its data had been renamed."""

    class Killed(BaseException):
        pass

    def kill(step: str) -> None:
        if step == "renamed":
            raise Killed

    monkeypatch.setattr(publish, "discard", lambda draft: None)
    monkeypatch.setattr(publish, "STEP_HOOK", kill)
    draft = store.begin(recipe, {})
    filled(draft)
    with pytest.raises(Killed):
        draft.publish(1, {})
    return draft


def test_renamed_data_are_published_only_if_they_are_what_the_record_beside_the_draft_says(
    store: Store, recipe: Recipe, filled: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    draft = killed_once_renamed(store, recipe, filled, monkeypatch)
    chunk = store.layout.entry(recipe.key) / "data.zarr/map/c/1/0"
    chunk.chmod(0o600)
    good = chunk.read_bytes()
    chunk.write_bytes(good[:-1] + bytes([good[-1] ^ 1]))
    assert draft.published() is None
    assert store.find(recipe.key) is None
    chunk.write_bytes(good)
    assert draft.published() == store.require(recipe.key)


def test_the_block_publishes_at_its_end(store: Store, recipe: Recipe, filled: Callable[..., None]) -> None:
    with store.begin(recipe, {}) as draft:
        filled(draft)
        assert store.find(recipe.key) is None
    entry = store.require(recipe.key)
    assert 0 < entry.seconds < 60


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_a_block_that_fails_leaves_nothing(
    store: Store, recipe: Recipe, filled: Callable[..., None], error: type[BaseException]
) -> None:
    with pytest.raises(error), store.begin(recipe, {}) as draft:
        filled(draft)
        raise error
    assert store.find(recipe.key) is None
    assert [path for path, thing in walk(store.root) if thing.is_file() and path != "CACHEDIR.TAG"] == []


def test_extras_that_are_not_json_leave_nothing(store: Store, draft: Draft, filled: Callable[..., None]) -> None:
    filled(draft)
    with pytest.raises(InvalidRecipe, match=r"extras|set"):
        draft.publish(0, {"a": {1}})
    assert not draft.path.exists()
    assert store.find(draft.recipe.key) is None


def test_threads_and_pickled_copies_write_one_result(store: Store, draft: Draft, make: Callable[..., Entry]) -> None:
    values = np.arange(400, dtype=np.float32).reshape(40, 10)
    draft.create_array("a", (40, 10), "float32", (2, 10), ("y", "x"), {})

    def write(row: int) -> None:
        copy = pickle.loads(pickle.dumps(draft))
        copy.write("a", (slice(row, row + 2), slice(None)), values[row : row + 2])

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(write, range(0, 40, 2)))
    copy = pickle.loads(pickle.dumps(draft))
    assert copy == draft
    np.testing.assert_array_equal(store.open(copy.publish(0, {}).key)["a"].values, values)


def test_a_region_can_be_written_again(
    store: Store, draft: Draft, filled: Callable[..., None], values: np.ndarray
) -> None:
    filled(draft, values + 1)
    draft.write("map", (slice(0, 3), slice(0, 3)), values)
    np.testing.assert_array_equal(store.open(draft.publish(0, {}).key)["map"].values, values)


@pytest.mark.parametrize("limit", [pytest.param(1, id="the first array"), pytest.param(600, id="a chunk")])
def test_a_disk_that_fills_up_is_explained_and_leaves_nothing(
    tmp_path: Path, run_script: Callable[..., str], limit: int
) -> None:
    printed = run_script(
        """
import resource
root, limit = sys.argv[1], int(sys.argv[2])
data = np.random.default_rng(0).normal(size=4000)
def work():
    from semidense.cache import CacheUnavailable
    store = Store(root)
    store.layout.create()
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    try:
        with store.begin(recipe, {}) as draft:
            draft.create_array("a", (4000,), "float64", (4000,), ("x",), {})
            draft.write("a", (slice(None),), data)
    except CacheUnavailable as error:
        print(error, flush=True)
in_child(work)
os.wait()
""",
        tmp_path / "cache",
        limit,
    )
    assert printed.count("\n") == 1
    assert "File too large; raise the limit" in printed
    assert list((tmp_path / "cache/drafts").iterdir()) == []


def test_a_root_that_is_a_file_is_explained(tmp_path: Path, recipe: Recipe) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CacheUnavailable, match=f"^cannot write to the cache at {tmp_path / 'file'}[^\n]*: [^\n]+file"):
        Store(tmp_path / "file").begin(recipe, {})


def test_who_goes_on_for_a_killed_publisher_has_all_on_disk_before_the_record_is_linked(
    store: Store, recipe: Recipe, filled: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    draft = killed_once_renamed(store, recipe, filled, monkeypatch)
    synced: list[set[int]] = [set()]
    real = os.fsync

    def note(handle: int) -> None:
        real(handle)
        synced[-1].add(os.fstat(handle).st_ino)

    monkeypatch.setattr("os.fsync", note)
    monkeypatch.setattr(publish, "STEP_HOOK", lambda step: synced.append(set()) if step == "record linked" else None)
    assert draft.published() == store.require(recipe.key)
    folder = store.layout.entry(recipe.key)
    inside = {path.stat().st_ino for path in (folder, *folder.rglob("*"), store.layout.record(recipe.key))}
    assert inside <= synced[0]
