from datetime import UTC, datetime, timedelta

import pytest

from semidense.pipeline.cli.commands.cache.listing import Selection, _age, bytes_text, list_entries, verify_entries
from semidense.pipeline.results.result import Result


@pytest.mark.parametrize(
    ("count", "text"),
    [
        (0, "0 B"),
        (999, "999 B"),
        (1000, "1 kB"),
        (1234, "1.23 kB"),
        (999_499, "999 kB"),
        (999_700, "1 MB"),
        (47_700_000, "47.7 MB"),
        (999_600_000, "0.9996 GB"),
        (12_345_678_901, "12.35 GB"),
    ],
)
def test_sizes_are_for_people(count: int, text: str) -> None:
    assert bytes_text(count) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(-5, "0 s"), (5, "5 s"), (59, "59 s"), (60, "1 min"), (7200, "2 h"), (3 * 86400, "3 d")],
)
def test_ages_are_for_people(seconds: int, text: str) -> None:
    assert _age((datetime.now(UTC) - timedelta(seconds=seconds)).isoformat()) == text


def test_entries_are_listed_oldest_first(trained: Result, capsys: pytest.CaptureFixture[str]) -> None:
    list_entries(trained.store.root, Selection(), as_json=False)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines[0][:4] == ["product", "dataset", "scene", "size"]
    assert lines[-2][0] == "metrics"
    assert lines[-1][1] == "entries,"


def test_a_sound_cache_is_said_to_be(trained: Result, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify_entries(trained.store.root, Selection(), as_json=False)
    assert capsys.readouterr().out == f"{len(list(trained.store.entries()))} sound, 0 damaged, 0 in quarantine\n"
