"""What ``gc --keep`` keeps: all that a dataset reaches, also what it will find again once a lost input is there."""

import shutil
from pathlib import Path

import pytest

from semidense.cache import Store
from semidense.cache.files import remove
from semidense.pipeline.api import Task, run, status
from semidense.pipeline.cli.commands.cache.cleaning import Wish
from semidense.pipeline.results.result import Result
from tests.tiny import TEST_ONLY


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Result:
    task = Task(TEST_ONLY, cache=tmp_path_factory.mktemp("cleaning") / "cache")
    run(task, settings=["semidense.R=0.3"])
    return run(task)


def keys_of(result: Result) -> set[str]:
    return {each.key for each in result.made.values()}


def kept(store: Store, *presets: str) -> frozenset[str] | None:
    return Wish(keep=(TEST_ONLY,), presets=presets).limits(str(store.root)).keep


def test_what_the_dataset_reaches_is_kept_and_nothing_else(made: Result) -> None:
    assert (
        kept(made.store) == keys_of(made) == {each.key for each in status(Task(TEST_ONLY), cache=made.store.root).steps}
    )
    assert len(list(made.store.entries())) == len(keys_of(made)) + 2, "the map and the figures of another R"


def test_a_preset_is_kept_if_it_is_named(made: Result, tmp_path: Path) -> None:
    store = copied(made, tmp_path)
    robust = run(Task(TEST_ONLY, cache=store.root, preset="robust"))
    assert not keys_of(robust) <= (kept(store) or frozenset())
    assert kept(store, "robust") == keys_of(robust)
    assert kept(store, "paper", "robust") == keys_of(made) | keys_of(robust)


def test_the_settings_that_a_run_finds_are_those_that_are_kept(
    made: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = copied(made, tmp_path)
    (tmp_path / "pipeline.toml").write_text("[channels]\nrank_window = 15\n")
    monkeypatch.chdir(tmp_path)
    other = run(Task(TEST_ONLY, cache=store.root, config=tmp_path / "pipeline.toml"), "channels")
    assert keys_of(other) <= (kept(store) or frozenset())
    assert made.find("channels").key not in (kept(store) or frozenset())


def test_what_is_below_a_damaged_entry_is_kept(made: Result, tmp_path: Path) -> None:
    """It will be found again, since what is made again has the digest that the record tells."""
    store = copied(made, tmp_path)
    remove(store.layout.entry(made.find("disparity").key))
    assert kept(store) == keys_of(made)


def test_what_is_below_a_lost_entry_is_kept(made: Result, tmp_path: Path) -> None:
    store = copied(made, tmp_path)
    store.layout.record(made.find("disparity").key).unlink()
    found = kept(store) or frozenset()
    assert found >= keys_of(made)
    more = [each.label["product"] for each in store.entries() if each.key in found - keys_of(made)]
    assert more == ["metrics"], "those of another R: it is not known yet whether this R finds them"


def copied(made: Result, folder: Path) -> Store:
    assert isinstance(made.store.root, Path)
    return Store(shutil.copytree(made.store.root, folder / "cache"))
