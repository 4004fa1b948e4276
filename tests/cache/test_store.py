import multiprocessing
import pickle
import threading
from collections.abc import Callable
from pathlib import Path

import dask
import numpy as np
import pytest

from semidense.cache import (
    CacheUnavailable,
    DamagedEntry,
    Entry,
    EntryNotFound,
    InvalidKey,
    InvalidRecipe,
    Recipe,
    Store,
)
from semidense.cache.entries.check import Policy
from semidense.cache.files import walk


def test_an_empty_cache_answers_and_makes_nothing(store: Store, recipe: Recipe) -> None:
    assert store.find(recipe.key) is None
    assert store.look(recipe.key) == (None, None)
    assert not store.has_all([recipe.key])
    assert "no entry has the key" in str(store.check(recipe.key))
    assert list(store.entries()) == []
    assert store.history({}) == []
    assert store.sweep_drafts() == 0
    with pytest.raises(EntryNotFound, match=r"^no entry has the key"):
        store.require(recipe.key)
    assert not store.root.exists()


def test_what_was_published_is_found(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    entry = make(store)
    assert store.find(recipe.key) == store.require(recipe.key) == entry
    assert store.check(recipe.key) is None
    assert store.look(recipe.key) == (entry, None)
    assert store.has_all([recipe.key])
    assert store.look_all([recipe.key, "0" * 64]) == [(store.find(recipe.key), None), (None, None)]
    assert (entry.label, entry.seconds, entry.extras) == (
        {"product": "square", "scene": "Teddy"},
        1.5,
        {"version": "0"},
    )
    assert (store.root / "CACHEDIR.TAG").read_text().startswith("Signature: 8a477f597d28d172789f06886806bc55")
    assert store.layout.record(recipe.key) == store.root / "records" / recipe.key[:2] / f"{recipe.key}.json"


@pytest.mark.parametrize("far", [False, True])
def test_only_in_a_far_place_several_entries_are_looked_at_at_a_time(
    store: Store, far: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads = set()
    monkeypatch.setattr(type(store.backend), "far", far)
    monkeypatch.setattr(Store, "look", lambda _, key: (threads.add(threading.get_ident()), key)[1])
    assert store.look_all(["b", "a", "c"]) == ["b", "a", "c"]
    assert (threading.get_ident() in threads) is not far


def test_a_look_finds_what_is_damaged_and_says_so(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    entry = make(store)
    chunk = next(path for path in sorted(store.layout.entry(recipe.key).rglob("*")) if path.parent.name == "c")
    chunk = next(path for path in sorted(chunk.rglob("*")) if path.is_file()) if chunk.is_dir() else chunk
    chunk.chmod(0o644)
    chunk.write_bytes(b"")
    found, damage = store.look(recipe.key)
    assert found == entry
    assert damage == store.check(recipe.key)
    assert "has 0 bytes" in str(damage)
    store.layout.record(recipe.key).chmod(0o644)
    store.layout.record(recipe.key).write_bytes(b"{}")
    assert store.look(recipe.key) == (None, None), "a record that cannot be read names no entry"


@pytest.mark.parametrize(
    "key", ["", "x", "../" * 20, "A" * 64, "0" * 63, "0" * 65, "0" * 64 + "\n", "/etc/passwd", "\u0660" * 64]
)
def test_keys_are_never_paths(store: Store, key: str) -> None:
    for ask in (store.find, store.check, store.look, store.require, store.open, store.claim, store.claimant):
        with pytest.raises(InvalidKey, match="is not a key"):
            ask(key)


def test_an_unknown_policy_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="full or size"):
        Store(tmp_path, "none")  # type: ignore[arg-type]


def test_opened_data_are_lazy_labelled_and_exact(store: Store, recipe: Recipe) -> None:
    with store.begin(recipe, {"scene": "Teddy"}) as draft:
        draft.create_array("volume", (4, 3), "int16", (2, 3), ("y", "d"), {"units": "s", "long_name": "seconds"}, -1)
        draft.create_array("d", (3,), "int16", (3,), ("d",), {"units": "px"})
        draft.write("volume", (slice(None), slice(None)), np.full((4, 3), -1, np.int16))
        draft.write("d", (slice(None),), np.array([5, 6, 7], np.int16))

    def refuse(*_: object, **__: object) -> None:
        raise RuntimeError("something was computed")

    with dask.config.set(scheduler=refuse):
        data = store.open(recipe.key)
        part = data["volume"].sel(d=6)
        with pytest.raises(RuntimeError, match="something was computed"):
            part.values  # noqa: B018
    assert data["volume"].chunks == ((2, 2), (3,))
    assert data["volume"].dtype == np.int16
    assert data["volume"].attrs == {"units": "s", "long_name": "seconds"}
    assert list(data.coords) == ["d"]
    np.testing.assert_array_equal(part.values, [-1] * 4)
    wanted = {"key": recipe.key, "stage": "square", "params": {"n": 3}, "inputs": {"images": "ab"}}
    assert {name: data.attrs[name] for name in wanted} == wanted
    assert {"digest", "code", "environment", "label", "created", "seconds", "extras"} < set(data.attrs)


@pytest.mark.parametrize("policy", ["full", "size"])
@pytest.mark.parametrize("damage", [Path.unlink, lambda path: (path.chmod(0o600), path.write_bytes(b"x"))])
def test_a_chunk_that_vanishes_after_opening_never_reads_as_fill(
    store: Store, make: Callable[..., Entry], recipe: Recipe, policy: Policy, damage: Callable[[Path], None]
) -> None:
    make(store)
    data = Store(store.root, policy).open(recipe.key)
    damage(store.layout.entry(recipe.key) / "data.zarr/map/c/1/0")
    with pytest.raises(DamagedEntry, match="changed or vanished"):
        data["map"].values  # noqa: B018
    np.testing.assert_array_equal(data["map"][0].values, [0, 1, np.nan])


def test_stores_and_opened_data_travel_to_other_processes(
    store: Store, make: Callable[..., Entry], recipe: Recipe
) -> None:
    make(store)
    again = pickle.loads(pickle.dumps(store))
    assert again == store
    data = pickle.loads(pickle.dumps(again.open(recipe.key)))
    assert data["map"].values[1, 1] == 4
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(again.find, (recipe.key,)) == store.find(recipe.key)


def test_paths_are_absolute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert Store(Path("here")).root == tmp_path / "here"


def test_history_is_newest_first_and_of_exactly_this_label(store: Store, make: Callable[..., Entry]) -> None:
    entries = [make(store, n=n) for n in range(4)]
    make(store, label={"scene": "Cones"}, n=9)
    assert store.history({"product": "square", "scene": "Teddy"}) == entries[::-1]
    assert store.history({"product": "square"}) == []
    assert len(list(store.entries())) == 5


def test_entries_skip_what_is_damaged_or_not_ours(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    make(store)
    folder = store.layout.record(recipe.key).parent
    (folder / "notes.txt").write_text("x")
    (folder / f"{recipe.key[:2]}{'0' * 62}.json").write_text("{}")
    (folder / f"{'f' * 64}.json").write_text("{}")
    (store.root / "records" / "notes").write_text("x")
    assert [entry.key for entry in store.entries()] == [recipe.key]


def test_labels_are_text(store: Store, recipe: Recipe) -> None:
    with pytest.raises(InvalidRecipe, match="label must map text to text"):
        store.begin(recipe, {"scene": 3})  # type: ignore[dict-item]
    assert not store.root.exists()


def test_drafts_of_the_dead_are_swept_and_those_of_the_living_kept(
    store: Store, recipe: Recipe, filled: Callable[..., None], run_script: Callable[..., str]
) -> None:
    mine = store.begin(recipe, {})
    filled(mine)
    run_script(
        """
def work():
    Store(sys.argv[1]).begin(recipe, {})
    die()
in_child(work)
os.wait()
""",
        store.root,
    )
    (store.layout.drafts / "notes").write_text("x")
    assert len(list(store.layout.drafts.iterdir())) == 3
    assert store.sweep_drafts() == 1
    assert store.sweep_drafts() == 0
    assert mine.publish(0, {}).key == recipe.key


def test_a_root_that_is_a_file_is_explained(tmp_path: Path, recipe: Recipe) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CacheUnavailable, match=r"^cannot read the cache at [^\n]+; [^\n]+$"):
        Store(tmp_path / "file").find(recipe.key)


def test_a_kill_while_an_entry_is_set_aside_leaves_nothing_visible(
    store: Store, make: Callable[..., Entry], recipe: Recipe, run_script: Callable[..., str]
) -> None:
    make(store)
    (store.layout.entry(recipe.key) / "data.zarr/map/c/1/0").unlink()
    run_script(
        """
def work():
    quarantine.move_anything = die
    Store(sys.argv[1]).require(recipe.key)
assert code(in_child(work)) == -signal.SIGKILL
""",
        store.root,
    )
    assert store.find(recipe.key) is None
    make(store)
    assert store.check(recipe.key) is None


def test_as_an_ordinary_user_a_read_only_cache_reads_and_is_explained(
    store: Store, make: Callable[..., Entry], recipe: Recipe, run_script: Callable[..., str]
) -> None:
    make(store)
    for path, thing in [*walk(store.root)]:
        if thing.is_dir():
            (store.root / path).chmod(0o555)
    store.root.chmod(0o555)
    printed = run_script(
        """
from semidense.cache import CacheError
store = Store(sys.argv[1])
print("root still" if os.access(sys.argv[1], os.W_OK) else "ordinary")
print(store.open(recipe.key)["map"].values[1, 1])
for attempt in (lambda: make(sys.argv[1]), lambda: store.claim(recipe.key)):
    try:
        attempt()
    except CacheError as error:
        print(type(error).__name__, error)
""",
        store.root,
        root=False,
    )
    kind, *lines = printed.splitlines()
    if kind == "root still":
        pytest.skip("root's rights cannot be dropped here")
    assert lines[0] == "4.0"
    assert len(lines) == 3
    assert all("CacheUnavailable cannot write to the cache at" in line for line in lines[1:])
    assert all("Permission denied; check its permissions" in line for line in lines[1:])


def test_as_an_ordinary_user_everything_works(tmp_path: Path, run_script: Callable[..., str]) -> None:
    printed = run_script(
        """
root = Path(sys.argv[1])
store = Store(root / "cache")
first = make(root / "cache")
(store.layout.entry(first.key) / "data.zarr/map/c/1").chmod(0o755)
(store.layout.entry(first.key) / "data.zarr/map/c/1/0").unlink()
try:
    store.require(first.key)
except OSError as error:
    print(error)
print(make(root / "cache").digest == first.digest, store.check(first.key))
print(len(list(store.layout.quarantine.iterdir())), len(list(store.layout.drafts.iterdir())))
from semidense.cache.files import remove
remove(root / "cache")
print((root / "cache").exists())
""",
        tmp_path,
        root=False,
    )
    lines = printed.splitlines()
    assert "is missing" in lines[0]
    assert lines[1:] == ["True None", "1 0", "False"]


def test_a_folder_of_somebody_s_files_is_refused_and_stays(
    tmp_path: Path, make: Callable[..., Entry], recipe: Recipe
) -> None:
    home = tmp_path / "home"
    (home / "locks").mkdir(parents=True)
    (home / "locks" / "key.pem").write_text("kept")
    for work in (make, lambda store: store.claim(recipe.key), Store.sweep_drafts, Store.entries):
        with pytest.raises(CacheUnavailable, match=rf"^{home} is not a cache: it holds 'locks' but no CACHEDIR.TAG"):
            work(Store(home))
    assert (home / "locks" / "key.pem").read_text() == "kept"
    assert [path.name for path in home.iterdir()] == ["locks"]


def test_an_empty_folder_and_a_link_to_one_become_caches(tmp_path: Path, make: Callable[..., Entry]) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "empty")
    entry = make(Store(tmp_path / "link"))
    assert Store(tmp_path / "empty").require(entry.key) == entry


def test_a_tag_that_a_full_disk_cut_short_is_written_again(store: Store, make: Callable[..., Entry]) -> None:
    store.root.mkdir()
    (store.root / "CACHEDIR.TAG").write_text("Signature")
    make(store)
    assert (store.root / "CACHEDIR.TAG").read_text().count("\n") == 2
    assert [path.name for path in store.root.glob("CACHEDIR*")] == ["CACHEDIR.TAG"]


@pytest.mark.parametrize("url", ["https://example.org/cache", "file:///tmp/x", "ftp://a/b", "s3://"])
def test_a_url_of_another_kind_is_refused_in_one_line(url: str) -> None:
    for root in (url, Path(url)):
        with pytest.raises(
            CacheUnavailable,
            match=r"^[a-z0-9]+:[^\n]* is no place for a cache: name a folder, or an object store as s3://[^\n]+$",
        ):
            Store(root)


def test_a_url_with_a_line_break_is_no_folder() -> None:
    with pytest.raises(CacheUnavailable, match="holds a line break"):
        Store("s3://bucket/x\n")


@pytest.mark.parametrize("root", ["s3://bucket/x", "S3://bucket/x/", Path("s3://bucket/x")])
def test_a_url_has_one_spelling_also_where_a_path_lost_a_slash(root: Path | str) -> None:
    assert Store(root).root == "s3://bucket/x"


def test_every_look_at_opened_files_goes_through_the_manifest(
    store: Store, make: Callable[..., Entry], recipe: Recipe
) -> None:
    import asyncio

    from zarr.abc.store import RangeByteRequest
    from zarr.core.buffer import default_buffer_prototype

    make(store)
    group = store.arrays(recipe.key)["map"].store
    folder = store.layout.entry(recipe.key) / "data.zarr"
    (folder / "map").chmod(0o755)
    (folder / "map" / "stray").write_bytes(b"x")
    (folder / "map/c/1").chmod(0o755)
    (folder / "map/c/1/0").unlink()

    async def look() -> None:
        part = RangeByteRequest(0, 4)
        assert not await group.exists("map/stray")
        assert await group.exists("map/c/1/0")
        assert [name async for name in group.list_dir("map")] == ["c", "zarr.json"]
        assert "map/stray" not in [key async for key in group.list()]
        assert [key async for key in group.list_prefix("map/c/1")] == ["map/c/1/0"]
        assert await group.getsize("map/c/1/0") > 0
        assert await group.get_partial_values(default_buffer_prototype(), [("map/stray", part)]) == [None]
        with pytest.raises(DamagedEntry, match="changed or vanished"):
            await group.get_partial_values(default_buffer_prototype(), [("map/c/1/0", part)])

    asyncio.run(look())


@pytest.mark.parametrize(
    "at_once", [pytest.param(0, id="in one of zarr's threads"), pytest.param(1 << 16, id="at once")]
)
def test_a_file_that_vanishes_or_changes_its_size_while_its_entry_is_open_is_damage(
    store: Store, make: Callable[..., Entry], recipe: Recipe, monkeypatch: pytest.MonkeyPatch, at_once: int
) -> None:
    make(store)
    monkeypatch.setattr("semidense.cache.entries.reader._AT_ONCE", at_once)
    array, expected = store.arrays(recipe.key)["map"], store.read(recipe.key)["map"]
    np.testing.assert_array_equal(array[...], expected)
    chunk = store.layout.entry(recipe.key) / "data.zarr/map/c/1/0"
    data = chunk.read_bytes()
    chunk.chmod(0o644)
    chunk.parent.chmod(0o755)
    chunk.write_bytes(data[:-1])
    with pytest.raises(DamagedEntry, match="changed or vanished"):
        array[...]
    chunk.unlink()
    with pytest.raises(DamagedEntry, match="changed or vanished"):
        array[...]
