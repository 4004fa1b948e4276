from collections.abc import Callable
from pathlib import Path

import pytest

from semidense.cache import CacheUnavailable, Store
from semidense.pipeline.execution.checkpoints import Checkpoints

KEY = "ab" * 32


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The file that a checkpoint is kept in."""
    return Store(tmp_path).layout.checkpoint(KEY)


def test_the_latest_checkpoint_comes_back(tmp_path: Path) -> None:
    kept = Checkpoints(Store(tmp_path).checkpoint(KEY))
    assert kept.load() is None
    kept.save(b"one")
    kept.save(b"two")
    assert Checkpoints(Store(tmp_path).checkpoint(KEY)).load() == b"two"


def test_an_empty_state_is_a_state(tmp_path: Path) -> None:
    kept = Checkpoints(Store(tmp_path).checkpoint(KEY))
    kept.save(b"")
    assert kept.load() == b""


def test_another_key_does_not_see_it(tmp_path: Path) -> None:
    Checkpoints(Store(tmp_path).checkpoint(KEY)).save(b"one")
    assert Checkpoints(Store(tmp_path).checkpoint("cd" * 32)).load() is None


def test_nothing_is_left_when_it_is_removed(tmp_path: Path, file: Path) -> None:
    kept = Checkpoints(Store(tmp_path).checkpoint(KEY))
    kept.save(b"one")
    (file.parent / f".{KEY}.123.ab.tmp").write_bytes(b"half")
    kept.kept.remove()
    kept.kept.remove()
    assert kept.load() is None
    assert list(file.parent.iterdir()) == []


@pytest.mark.parametrize(
    "damage", [lambda data: data[:-1], lambda data: data[:5], lambda data: b"", lambda data: data + b"x"]
)
def test_from_a_damaged_checkpoint_nothing_resumes(
    tmp_path: Path, file: Path, damage: Callable[[bytes], bytes]
) -> None:
    kept = Checkpoints(Store(tmp_path).checkpoint(KEY))
    kept.save(b"state")
    file.write_bytes(damage(file.read_bytes()))
    assert kept.load() is None


def test_every_flipped_byte_is_noticed(tmp_path: Path, file: Path) -> None:
    kept = Checkpoints(Store(tmp_path).checkpoint(KEY))
    kept.save(b"state")
    data = file.read_bytes()
    for place in range(len(data)):
        file.write_bytes(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :])
        assert kept.load() is None


def test_a_write_that_fails_leaves_the_earlier_one(tmp_path: Path, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = Checkpoints(Store(tmp_path).checkpoint(KEY))
    kept.save(b"one")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(CacheUnavailable, match="No space left on device; free some space"):
        kept.save(b"two")
    assert kept.load() == b"one"
    assert [path.name for path in file.parent.iterdir()] == [KEY]


def test_progress_is_passed_on_where_somebody_listens(tmp_path: Path) -> None:
    told: list[tuple[int, int, str]] = []
    Checkpoints(Store(tmp_path).checkpoint(KEY), lambda *what: told.append(what)).progress(1, 2, "loss")
    Checkpoints(Store(tmp_path).checkpoint(KEY)).progress(1, 2)
    assert told == [(1, 2, "loss")]
