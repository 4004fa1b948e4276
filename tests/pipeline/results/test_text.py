import io
from pathlib import Path

import pytest
from rich.console import Console
from rich.table import Table

from semidense.pipeline.results.result import Result
from semidense.pipeline.results.text import bytes_text, opening_text, print_table, time_text, value_text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        pytest.param("fast", "fast", id="text"),
        pytest.param(0.9, "0.9", id="number"),
        pytest.param(False, "false", id="as --set takes it"),
        pytest.param(None, "null", id="open"),
        pytest.param(["gray", "rank"], "gray,rank", id="list"),
        pytest.param(list(range(9)), "0 and 8 more", id="long list"),
        pytest.param("ab" * 32, "abababababab", id="hash"),
        pytest.param(["ab" * 32] * 4, "abababababab and 3 more", id="many hashes"),
    ],
)
def test_a_value_is_short_and_readable(value: object, text: str) -> None:
    assert value_text(value) == text


def test_a_time_is_told_to_the_second() -> None:
    assert time_text("2026-11-28T16:03:17.123456+00:00") == "2026-11-28 16:03:17"


def test_bytes_have_a_unit() -> None:
    assert [bytes_text(count) for count in (999, 999_600, 47_700_000)] == ["999 B", "1 MB", "47.7 MB"]


def test_the_code_that_opens_a_product_opens_it(trained: Result) -> None:
    made = trained.find("disparity", "test-0")
    imports, _, opening = opening_text(Path(trained.store.root), made.key).partition("; ")
    names: dict[str, object] = {}
    exec(imports, names)
    assert eval(opening, names).attrs["key"] == made.key


NUMBERS = {"name": "costvolume", "a": "1,234.56", "b": "-0.125", "c": "98.76 %"}


@pytest.mark.parametrize(
    ("width", "left_out"),
    [
        pytest.param(80, [], id="wide enough"),
        pytest.param(33, ["b"], id="the least important one"),
        pytest.param(24, ["b", "c"], id="two"),
    ],
)
def test_a_narrow_table_leaves_columns_out_and_cuts_no_number(width: int, left_out: list[str]) -> None:
    table = Table(*NUMBERS, box=None)
    table.add_row(*NUMBERS.values())
    console = Console(file=io.StringIO(), width=width)
    print_table(table, console, ("b", "absent", "c"))
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    rows = shown.splitlines()[:2]
    assert rows[0].split() == [name for name in NUMBERS if name not in left_out]
    assert rows[1].split() == " ".join(text for name, text in NUMBERS.items() if name not in left_out).split()
    assert ("left out at this width: " + ", ".join(left_out) in " ".join(shown.split())) == bool(left_out)


@pytest.mark.parametrize("width", [30, 80, 240])
def test_a_table_that_is_too_wide_is_printed_in_parts(width: int) -> None:
    heads = [f"scene {place}" for place in range(12)]
    table = Table("method", *heads, title="raw maps", box=None, pad_edge=False)
    for column in table.columns[1:]:
        column.justify = "right"
    for name in ("dual-cnn, shipped weights", "SGM"):
        table.add_row(name, *(f"{place + 0.25:.2f}" for place in range(12)))
    shown = io.StringIO()
    print_table(table, Console(file=shown, width=width))
    lines = shown.getvalue().splitlines()
    assert max(map(len, lines)) <= width
    assert all(f"{place + 0.25:.2f}" in shown.getvalue() for place in range(12))
    if width == 240:
        assert all(head in shown.getvalue() for head in heads)
    else:
        assert shown.getvalue().count("scene") == 12, "each head is there, broken between its words"
    assert "…" not in shown.getvalue()
    parts = shown.getvalue().count("method")
    assert parts == shown.getvalue().count("SGM")
    assert (parts == 1) == (width == 240)
    assert lines[0].strip() == "raw maps" and shown.getvalue().count("raw maps") == 1, "the title stands once"


def test_a_title_is_as_wide_as_the_terminal_and_not_as_its_table() -> None:
    table = Table("scene", "AUC", title="area under the error curve; lower is better [nonocc]", box=None)
    table.add_row("Teddy", "0.0040")
    shown = io.StringIO()
    print_table(table, Console(file=shown, width=80))
    assert shown.getvalue().splitlines()[0] == "area under the error curve; lower is better [nonocc]"


def test_a_long_text_is_folded_and_not_cut() -> None:
    table = Table("scene", "error", "settings", box=None)
    table.columns[1].justify = "right"
    table.add_row("Aloe@Illum1.Exp0-Illum3.Exp2", "12.34", "costvolume.mode=guided, channels.rank_window=15")
    shown = io.StringIO()
    print_table(table, Console(file=shown, width=50))
    lines = shown.getvalue().splitlines()
    assert max(map(len, lines)) <= 50
    assert "12.34" in lines[1]
    told = "".join(line[24:].strip() for line in lines).replace(" ", "")
    assert told.endswith("costvolume.mode=guided,channels.rank_window=15")
    assert "…" not in shown.getvalue()


def test_heads_are_broken_before_a_column_is_left_out() -> None:
    table = Table("scene", "disparities px", "rows x columns", box=None)
    for column in table.columns[1:]:
        column.justify = "right"
    table.add_row("Teddy", "0..59", "375 x 450")
    shown = io.StringIO()
    print_table(table, Console(file=shown, width=33), ("rows x columns",))
    first, second, third = shown.getvalue().splitlines()
    assert (first.split(), second.split()) == (["disparities", "rows", "x"], ["scene", "px", "columns"])
    assert third.split() == ["Teddy", "0..59", "375", "x", "450"]
