from collections.abc import Callable

import pytest

from semidense.cache import Entry, InvalidKey, Recipe, Store
from semidense.cache.upkeep.verify import size, verify


def test_an_empty_cache(store: Store) -> None:
    report = verify(store)
    assert (report.sound, report.damaged, report.quarantined) == ((), {}, {})
    assert size(store).total == 0


def test_every_entry_is_read_and_nothing_changed(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    keys = sorted(make(store, n=n).key for n in range(4))
    bad, gone = keys[1], keys[2]
    path = store.layout.entry(bad) / "data.zarr/map/c/0/0"
    path.chmod(0o600)
    path.write_bytes(bytes(path.stat().st_size))
    store.layout.record(gone).chmod(0o600)
    store.layout.record(gone).write_text("{}")
    seen: list[tuple[int, int]] = []
    report = verify(Store(store.root, "size"), progress=lambda done, total: seen.append((done, total)))
    assert report.sound == (keys[0], keys[3])
    assert set(report.damaged) == {bad, gone}
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert report.quarantined == {}
    assert verify(store, [keys[0]]).sound == (keys[0],)


def test_what_was_set_aside_is_listed_with_its_reason(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    make(store)
    (store.layout.entry(recipe.key) / "data.zarr/map/c/0/0").unlink()
    with pytest.raises(OSError, match="is missing"):
        store.require(recipe.key)
    (store.layout.quarantine / f"{recipe.key}-00ff00ff").mkdir()
    report = verify(store)
    assert report.sound == ()
    reasons = sorted(report.quarantined.values())
    assert reasons[0].startswith("the entry ")
    assert reasons[0].endswith("data.zarr/map/c/0 is missing") or "is missing" in reasons[0]
    assert reasons[1].startswith("unknown")


def test_named_keys_must_be_there(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    make(store)
    assert list(verify(store, ["0" * 64]).damaged) == ["0" * 64]
    with pytest.raises(InvalidKey):
        verify(store, ["x"])


def test_sizes_add_up(store: Store, make: Callable[..., Entry], recipe: Recipe) -> None:
    first, second, third = make(store), make(store, n=4), make(store, label={"scene": "Cones"}, n=5)
    store.layout.record(third.key).unlink()
    draft = store.begin(recipe, {})
    (draft.path / "x").write_bytes(bytes(7))
    sizes = size(store)
    assert sizes.stages == {"square": first.size + second.size}
    assert sizes.drafts == 7
    assert sizes.orphans > third.size  # its manifest counts too
    assert sizes.quarantine == 0
    assert sizes.total > first.size * 2 + sizes.orphans + sizes.drafts
