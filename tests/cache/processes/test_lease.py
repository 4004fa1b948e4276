from collections.abc import Callable
from pathlib import Path

import pytest

from semidense.cache import Entry, InvalidKey, Recipe, Store
from semidense.cache.processes.lease import cleaning, in_use, leased, sweep_checkpoints

KEYS = ("ab" * 32, "cd" * 32)


def test_what_is_leased_is_in_use_until_the_block_ends(store: Store) -> None:
    with leased(store.layout) as lease:
        assert in_use(store.layout) == frozenset()
        lease.add(KEYS[:1])
        with leased(store.layout) as other:
            other.add(KEYS)
            assert in_use(store.layout) == set(KEYS)
        assert in_use(store.layout) == {KEYS[0]}
    assert in_use(store.layout) == frozenset()
    assert list(store.layout.leases.iterdir()) == []


def test_a_lease_dies_with_its_process(store: Store, run_script: Callable[..., str]) -> None:
    run_script(
        """
def work():
    with Store(sys.argv[1]).lease() as lease:
        lease.add(["ab" * 32])
        die()
assert code(in_child(work)) == -signal.SIGKILL
""",
        store.root,
    )
    assert len(list(store.layout.leases.iterdir())) == 1
    assert in_use(store.layout) == frozenset()
    store.sweep_drafts()
    assert list(store.layout.leases.iterdir()) == []


def test_a_half_written_line_is_no_key(store: Store) -> None:
    with leased(store.layout) as lease:
        assert lease.path
        with lease.path.open("a") as file:
            file.write("ab" * 20)
        assert in_use(store.layout) == frozenset()


@pytest.mark.parametrize("key", ["", "../x", "AB" * 32])
def test_only_keys_are_leased(store: Store, key: str) -> None:
    with leased(store.layout) as lease, pytest.raises(InvalidKey):
        lease.add([key])


def test_a_cache_that_cannot_be_written_needs_no_lease(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with leased(Store(tmp_path / "file").layout) as lease:
        lease.add(KEYS)
        assert lease.path is None


def test_using_an_entry_is_noted(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    import os

    make(store)
    os.utime(store.layout.record(recipe.key), (1, 1))
    with store.lease() as lease:
        lease.add([recipe.key])
    assert store.layout.record(recipe.key).stat().st_mtime > 1e9
    assert store.check(recipe.key) is None


def test_adding_waits_for_cleaning(store: Store) -> None:
    import threading

    with store.lease() as lease:
        thread = threading.Thread(target=lease.add, args=(KEYS,))
        with cleaning(store.layout):
            thread.start()
            thread.join(0.1)
            assert thread.is_alive()
        thread.join(5)
        assert in_use(store.layout) == set(KEYS)


def test_checkpoints_of_what_is_there_are_swept(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    make(store)
    store.layout.checkpoints.mkdir()
    for key in (recipe.key, KEYS[0]):
        store.layout.checkpoint(key).write_bytes(b"x")
    claim = store.claim(recipe.key)
    assert claim
    sweep_checkpoints(store.layout)
    assert store.layout.checkpoint(recipe.key).exists(), "somebody makes it again"
    claim.release()
    sweep_checkpoints(store.layout)
    assert [path.name for path in store.layout.checkpoints.iterdir()] == [KEYS[0]]
