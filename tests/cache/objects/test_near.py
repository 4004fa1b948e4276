import hashlib
import os
from pathlib import Path

import pytest

from semidense.cache import CacheUnavailable
from semidense.cache.objects.near import Near, near


def sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def keep(kept: Near, *several: bytes) -> None:
    for age, data in enumerate(several):
        kept.keep(sha256(data), data)
        path = next(Path(kept._folder).glob(f"*/{sha256(data)}"), None)
        if path:
            os.utime(path, (age, age))


def test_bytes_come_back_by_their_hash_and_damaged_ones_do_not(tmp_path: Path) -> None:
    kept = Near(tmp_path, 100)
    assert kept.get(sha256(b"one")) is None
    keep(kept, b"one")
    assert kept.get(sha256(b"one")) == b"one"
    (file,) = tmp_path.glob("*/*")
    file.write_bytes(b"two")
    assert kept.get(sha256(b"one")) is None
    assert list(tmp_path.glob("*/*")) == [], "a damaged file is deleted"


def test_what_was_read_longest_ago_goes_first_when_the_limit_is_passed(tmp_path: Path) -> None:
    kept = Near(tmp_path, 100)
    keep(kept, *(bytes([letter]) * 30 for letter in b"abc"))
    assert kept.get(sha256(b"a" * 30)) == b"a" * 30, "read now: b is the oldest"
    kept.keep(sha256(b"d" * 30), b"d" * 30)  # 120 bytes: down to at most 80
    left = {path.read_bytes()[:1] for path in tmp_path.glob("*/*")}
    assert left == {b"a", b"d"}


def test_what_does_not_fit_and_a_folder_that_cannot_be_written_keep_nothing(tmp_path: Path) -> None:
    keep(Near(tmp_path / "small", 2), b"one")
    assert not (tmp_path / "small").exists()
    (tmp_path / "file").touch()
    keep(Near(tmp_path / "file", 100), b"one")
    assert (tmp_path / "file").read_bytes() == b""


def test_the_environment_says_where_and_how_much(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIPELINE_NEAR", str(tmp_path / "here"))
    monkeypatch.setenv("PIPELINE_NEAR_BYTES", "3")
    keep(near(), b"one", b"four")
    assert [path.read_bytes() for path in (tmp_path / "here").glob("*/*")] == [b"one"]


@pytest.mark.parametrize("text", ["5GB", "-1", "1e9", "9" * 5000])
def test_a_limit_that_is_no_number_of_bytes_is_refused(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv("PIPELINE_NEAR_BYTES", text)
    with pytest.raises(CacheUnavailable, match=r"PIPELINE_NEAR_BYTES is .*: write a number of bytes"):
        near()
