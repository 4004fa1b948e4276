import pickle
from pathlib import Path

import numpy as np
import pytest

from semidense.cache import DamagedEntry, Recipe, Store
from semidense.pipeline.execution import jobs as recent
from semidense.pipeline.execution.jobs import Recent, Unread
from semidense.pipeline.execution.tiles import cut_rows, read_block
from semidense.stages.stage import NoParams, Stage


def publish(store: Store, value: float, size: int = 4) -> str:
    recipe = Recipe("map", {}, {"value": value}, {}, {})
    with store.begin(recipe, {"product": "map"}) as draft:
        draft.create_array("map", (size,), "float64", (size,), ("x",), {})
        draft.write("map", (slice(0, size),), np.full(size, value))
    return recipe.key


def test_what_was_read_once_is_not_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store, kept = Store(tmp_path), Recent()
    key = publish(store, 1.5)
    assert kept.read(store, key)["map"].tolist() == [1.5] * 4
    monkeypatch.setattr(Store, "arrays", lambda *_: pytest.fail("read again"))
    assert kept.read(store, key)["map"].tolist() == [1.5] * 4


def test_tiles_share_one_reading_of_a_small_product_and_own_their_parts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, kept = Store(tmp_path), Recent()
    recipe = Recipe("map", {}, {}, {}, {})
    with store.begin(recipe, {"product": "map"}) as draft:
        draft.create_array("map", (6, 1), "float64", (2, 1), ("y", "x"), {})
        draft.write("map", (slice(0, 6), slice(0, 1)), np.arange(6.0)[:, None])
    opened, real = [], Store.arrays
    monkeypatch.setattr(Store, "arrays", lambda self, key: opened.append(key) or real(self, key))
    tiled = Stage("p", (), (), "m:f", tile_rows=2, halo=lambda _: 1)
    for _ in range(2):
        for rows, expected in zip(cut_rows(6, 2), ([0, 1, 2], [1, 2, 3, 4], [3, 4, 5]), strict=True):
            part = read_block(kept.open(store, recipe.key), rows, tiled, NoParams())["map"]
            assert part.ravel().tolist() == expected
            part[:] = -1
    assert opened == [recipe.key]


def test_what_a_caller_does_to_it_stays_with_the_caller(tmp_path: Path) -> None:
    store, kept = Store(tmp_path), Recent()
    key = publish(store, 1.5)
    for _ in range(2):
        made = kept.read(store, key)["map"]
        assert made.tolist() == [1.5] * 4
        made[:] = 0


@pytest.mark.parametrize(
    ("most", "large", "kept_keys"),
    [
        pytest.param(96, 96, 3, id="all fit"),
        pytest.param(64, 64, 2, id="the one read longest ago goes"),
        pytest.param(96, 31, 0, id="a large one is never kept"),
    ],
)
def test_keeps_no_more_than_it_may(
    most: int, large: int, kept_keys: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recent, "MOST_BYTES", most)
    monkeypatch.setattr(recent, "LARGE", large)
    store, kept = Store(tmp_path), Recent()
    keys = [publish(store, value) for value in (1.0, 2.0, 3.0)]
    for key in keys:
        kept.read(store, key)
    assert list(kept._kept) == keys[3 - kept_keys :]


def test_damage_is_found_at_the_first_reading(tmp_path: Path) -> None:
    store = Store(tmp_path)
    key = publish(store, 1.5)
    chunk = next(path for path in (tmp_path / "entries").rglob("c/0"))
    chunk.chmod(0o644)
    chunk.write_bytes(bytes([chunk.read_bytes()[0] ^ 1]) + chunk.read_bytes()[1:])
    with pytest.raises(DamagedEntry):
        Recent().read(store, key)


def test_travels_empty(tmp_path: Path) -> None:
    store, kept = Store(tmp_path), Recent()
    kept.read(store, publish(store, 1.5))
    assert not pickle.loads(pickle.dumps(kept))._kept


def test_an_unread_product_reads_what_is_asked_for_and_keeps_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, real = Store(tmp_path), Store.arrays
    opened: list[str] = []
    monkeypatch.setattr(Store, "arrays", lambda self, key: opened.append(key) or real(self, key))
    key = publish(store, 1.5)
    product = Unread(store, key)
    assert opened == []
    for _ in range(2):
        assert product["map"].tolist() == [1.5] * 4
    assert opened == [key] * 2
    assert list(product) == ["map"] and len(product) == 1
    with pytest.raises(KeyError):
        product["mop"]
