"""The quick form of the fault matrix; `make faults` runs the large one."""

import json
from pathlib import Path

import pytest

from semidense.cache import Store
from tests.faults import world
from tests.faults.__main__ import MARKS, QUOTES
from tests.faults.damage import DAMAGE, SAME_SIZE, unlock
from tests.faults.matrix import PROMISED, ROWS, Row, markdown, run_row, summary, total

PROJECT = Path(__file__).parents[2]
LEAST = {1: 6, 2: 2, 3: 1, 4: 2, 5: 7, 6: 400, 7: 50, 8: 20, 9: 1000, 10: 50, 11: 80, 12: 200,
         13: 1, 14: 2, 15: 4, 16: 11, 17: 4, 18: 14, 19: 5, 20: 6, 21: 8, 22: 4, 23: 2, 24: 4,
         25: 2, 26: 40, 27: 4, 28: 20, 29: 2}  # fmt: skip
"""Faults that the quick form of each row injects at least: a row that does nothing would pass otherwise."""


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.number} {row.title}")
def test_nothing_is_wrong_lost_left_over_or_unexplained(row: Row) -> None:
    found = run_row(row, row.quick)
    assert found["notes"] == []
    assert found["injected"] >= LEAST[row.number]
    assert not any(count for name, count in total([found]).items() if name != "injected")


needs_outcome = pytest.mark.skipif(
    not (PROJECT / "docs/faults.json").exists(), reason="no outcome to compare with: run `make faults`"
)


@needs_outcome
def test_what_the_documents_quote_is_what_make_faults_found() -> None:
    rows = json.loads((PROJECT / "docs/faults.json").read_text())["rows"]
    for name, text in QUOTES.items():
        assert MARKS.search((PROJECT / name).read_text())[0] == f"<!-- make faults -->\n{text(rows)}\n<!-- end -->"  # type: ignore[index]


@needs_outcome
def test_the_large_form_is_as_large_as_promised_and_clean() -> None:
    found = json.loads((PROJECT / "docs/faults.json").read_text())
    assert [row["row"] for row in found["rows"]] == [row.number for row in ROWS]
    assert found["total"]["injected"] >= PROMISED
    assert [count for name, count in found["total"].items() if name != "injected"] == [0, 0, 0, 0]
    assert str(f"{found['total']['injected']:,}") in markdown(found["rows"])
    assert summary(found["rows"]).count("\n") == 0


@pytest.mark.parametrize("name", [*DAMAGE, *SAME_SIZE])
def test_the_same_damage_can_strike_twice(name: str) -> None:
    with world.folder() as root:
        store = Store(root)
        for _ in range(2):
            made = world.run(store, world.small(0))
            key = min(each.key for each in made.values())
            unlock(store, key)
            {**DAMAGE, **SAME_SIZE}[name](store.layout.entry(key), store.layout.record(key))
            assert store.check(key) is not None
