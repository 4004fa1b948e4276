import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from semidense.cache import Entry, NonDeterministicStage, Recipe, Store
from semidense.cache.entries import check, publish
from semidense.cache.entries.publish import STEPS
from semidense.cache.files import walk

Run = Callable[..., str]
VISIBLE_FROM = STEPS.index("record linked")

KILLS = """
import zarr.codecs  # before the forks, once for all
# a folder a step: first made by a process that is killed there, then by one that is not
steps, base = publish.STEPS, Path(sys.argv[1])
for number, step in enumerate(steps):
    root = base / str(number)
    def work():
        publish.STEP_HOOK = lambda done: die() if done == step else None
        make(root)
    assert code(in_child(work)) == -signal.SIGKILL, step
print("done")
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory, run_script: Run) -> Path:
    base = tmp_path_factory.mktemp("killed")
    assert run_script(KILLS, base) == "done\n"
    return base


@pytest.mark.parametrize("step", STEPS)
def test_a_kill_leaves_a_whole_entry_or_nothing_visible(
    killed: Path, recipe: Recipe, make: Callable[..., Entry], values: np.ndarray, step: str
) -> None:
    store = Store(killed / str(STEPS.index(step)))
    entry = store.find(recipe.key)
    assert (entry is not None) == (STEPS.index(step) >= VISIBLE_FROM)
    assert [found.key for found in store.entries()] == ([recipe.key] if entry else [])
    assert (store.check(recipe.key) is None) == (entry is not None)
    again = make(store)
    assert entry is None or again == entry
    assert store.check(recipe.key) is None
    np.testing.assert_array_equal(store.open(recipe.key)["map"].values, values)
    store.sweep_drafts()
    assert list(store.layout.drafts.iterdir()) == []
    assert list(store.layout.quarantine.iterdir()) == []


def test_killed_and_undisturbed_runs_give_the_same_digest(
    killed: Path, store: Store, recipe: Recipe, make: Callable[..., Entry]
) -> None:
    after_kill = Store(killed / str(len(STEPS) - 1)).require(recipe.key)
    assert make(store).digest == after_kill.digest


def test_the_digest_depends_on_the_content_alone(
    tmp_path: Path, make: Callable[..., Entry], values: np.ndarray
) -> None:
    first, other_place = make(Store(tmp_path / "a")), make(Store(tmp_path / "b"), label={"scene": "Cones"}, n=4)
    assert first.key != other_place.key
    assert first.digest == other_place.digest
    assert make(Store(tmp_path / "c"), values + 1).digest != first.digest


def test_the_digest_is_pinned_to_the_files(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    import hashlib

    entry = make(store)
    folder = store.layout.entry(recipe.key)
    paths = sorted(path for path, thing in walk(folder) if thing.is_file() and path != "manifest.json")
    rows = [[p, (folder / p).stat().st_size, hashlib.sha256((folder / p).read_bytes()).hexdigest()] for p in paths]
    assert entry.digest == hashlib.sha256(json.dumps(rows, separators=(",", ":")).encode()).hexdigest()
    assert paths == [
        "data.zarr/map/c/0/0",
        "data.zarr/map/c/1/0",
        "data.zarr/map/zarr.json",
        "data.zarr/zarr.json",
    ]


def test_published_files_and_folders_are_read_only(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    make(store)
    folder = store.layout.entry(recipe.key)
    modes = {path: thing.stat().st_mode & 0o222 for path, thing in walk(folder)}
    assert len(modes) == 10  # four files, their manifest, five folders
    assert not any(modes.values())
    assert folder.stat().st_mode & 0o222 == 0
    assert store.layout.record(recipe.key).stat().st_mode & 0o222 == 0


def test_a_second_writer_of_the_same_content_drops_its_own(
    store: Store, make: Callable[..., Entry], recipe: Recipe
) -> None:
    first = make(store)
    inode = store.layout.entry(recipe.key).stat().st_ino
    assert make(store, label={"scene": "other"}) == first
    assert store.layout.entry(recipe.key).stat().st_ino == inode
    assert list(store.layout.drafts.iterdir()) == []


def test_a_second_result_that_differs_is_refused_and_the_first_is_kept(
    store: Store, make: Callable[..., Entry], recipe: Recipe, values: np.ndarray, tmp_path: Path
) -> None:
    first, other = make(store), make(Store(tmp_path / "other"), values + 1)
    with pytest.raises(NonDeterministicStage, match=r"^[^\n]+$") as caught:
        make(store, values + 1)
    assert first.digest in str(caught.value)
    assert other.digest in str(caught.value)
    assert store.require(recipe.key) == first
    assert list(store.layout.drafts.iterdir()) == []


@pytest.mark.parametrize("what", ["record", "manifest", "chunk", "folder"])
def test_a_damaged_entry_makes_way_for_a_new_one(
    store: Store, make: Callable[..., Entry], recipe: Recipe, what: str
) -> None:
    first = make(store)
    folder = store.layout.entry(recipe.key)
    files = {
        "record": store.layout.record(recipe.key),
        "manifest": folder / "manifest.json",
        "chunk": folder / "data.zarr/map/c/0/0",
    }
    if what == "folder":
        folder.rename(store.root / "elsewhere")
    else:
        files[what].chmod(0o600)
        files[what].write_bytes(files[what].read_bytes()[:-1])
    assert make(store).digest == first.digest
    assert store.check(recipe.key) is None
    assert len(list(store.layout.quarantine.iterdir())) == 1


@pytest.mark.parametrize("kind", ["file", "link", "folder"])
def test_data_without_a_record_are_replaced(
    store: Store, make: Callable[..., Entry], recipe: Recipe, kind: str, tmp_path: Path, values: np.ndarray
) -> None:
    target, outside = store.layout.entry(recipe.key), tmp_path / "outside"
    store.layout.create()
    target.parent.mkdir(parents=True)
    outside.mkdir()
    (outside / "kept").write_text("kept")
    if kind == "file":
        target.write_text("x")
    elif kind == "link":
        target.symlink_to(outside)
    else:
        (target / "data.zarr").mkdir(parents=True)
        (target / "manifest.json").write_text("{}")
    assert store.find(recipe.key) is None
    make(store)
    np.testing.assert_array_equal(store.open(recipe.key)["map"].values, values)
    assert (outside / "kept").read_text() == "kept"


RACE = """
import contextlib, time, zarr.codecs
base, rounds, same, locked = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3] == "same", sys.argv[4] == "locked"
if not locked:
    publish.held = lambda path: contextlib.nullcontext()
publish.STEP_HOOK = lambda done: time.sleep(0.002)
for number in range(rounds):
    start = time.time() + 0.02
    def work(values):
        time.sleep(max(0, start - time.time()))
        make(base / str(number), values)
    children = [in_child(lambda: work(values + (0 if same else child))) for child in range(4)]
    print(*sorted(code(child) for child in children))
"""


def test_processes_that_publish_the_same_content_agree(tmp_path: Path, run_script: Run, recipe: Recipe) -> None:
    assert run_script(RACE, tmp_path, 4, "same", "locked") == "0 0 0 0\n" * 4
    for number in range(4):
        store = Store(tmp_path / str(number))
        assert store.check(recipe.key) is None
        assert [len(list(path.iterdir())) for path in (store.layout.drafts, store.layout.quarantine)] == [0, 0]


def test_of_processes_that_publish_different_content_one_wins(tmp_path: Path, run_script: Run, recipe: Recipe) -> None:
    assert run_script(RACE, tmp_path, 3, "different", "locked") == "0 1 1 1\n" * 3
    for number in range(3):
        assert Store(tmp_path / str(number)).check(recipe.key) is None


@pytest.mark.parametrize("content", ["same", "different"])
def test_without_working_locks_nothing_wrong_is_ever_read(
    tmp_path: Path, run_script: Run, recipe: Recipe, make: Callable[..., Entry], values: np.ndarray, content: str
) -> None:
    run_script(RACE, tmp_path, 4, content, "unlocked")
    for number in range(4):
        store = Store(tmp_path / str(number))
        if store.check(recipe.key) is None:
            read = store.open(recipe.key)["map"].values - values
            assert np.nanmax(read) == np.nanmin(read)  # one writer's values, never a mixture
        elif content == "same":
            make(store)
            assert store.check(recipe.key) is None


def test_all_of_an_entry_is_on_disk_before_its_record_is_linked(
    store: Store, make: Callable[..., Entry], recipe: Recipe, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: set[int] = set()
    linked: list[set[int]] = []
    real = os.fsync

    def note(handle: int) -> None:
        real(handle)
        synced.add(os.fstat(handle).st_ino)

    monkeypatch.setattr("os.fsync", note)
    monkeypatch.setattr(publish, "STEP_HOOK", lambda step: linked.append({*synced}) if step == "entry synced" else None)
    make(store)
    folder, record = store.layout.entry(recipe.key), store.layout.record(recipe.key)
    inside = [folder / path for path, _ in walk(folder)]
    needed = [*inside, folder, *folder.parents[:2], record, record.parent.parent]
    assert {path.stat().st_ino for path in needed} <= linked[0]
    assert record.parent.stat().st_ino in synced, "so is the name that makes it exist, in the end"


def test_what_was_published_here_is_not_parsed_again(
    store: Store, make: Callable[..., Entry], monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = make(store, zeta=1, alpha=2)

    def refuse(*_: object) -> None:
        raise AssertionError("parsed")

    for documents in (check.RECORDS, check.MANIFESTS):
        monkeypatch.setattr(documents, "_parse", refuse)
    known = store.require(entry.key)
    monkeypatch.undo()
    check.forget()
    parsed = store.require(entry.key)
    assert known == parsed == entry
    assert str(known) == str(parsed), "their mappings have the same order, too"
