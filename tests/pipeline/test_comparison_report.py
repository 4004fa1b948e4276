"""The tables of a comparison in terminals of different widths."""

import io

import pytest
from rich.console import Console

from pipeline.ablation import ABLATION
from pipeline.comparison import MATCHERS
from pipeline.comparison_report import _by_scene, _fitted
from pipeline.comparison_rows import OURS

SCENES = ("Motorcycle", "MotorcycleE", "Piano", "PianoL", "Pipes", "Playroom", "Shelves", "Teddy")
METHODS = (f"{OURS}, shipped weights", *MATCHERS, *ABLATION)


def printed(width: int) -> list[str]:
    rows = [{"scene": scene, "method": method, "raw_bad": 20.123} for scene in SCENES for method in METHODS]
    means = [{"scene": "mean of 8", "method": method, "raw_bad": 20.1} for method in METHODS]
    console = Console(file=io.StringIO(), width=width)
    console.print(_fitted(_by_scene(rows, means, "raw", "raw_bad"), console))
    return console.file.getvalue().splitlines()  # type: ignore[attr-defined, no-any-return]


@pytest.mark.parametrize("width", [100, 240])
def test_nothing_is_cut(width: int) -> None:
    lines = printed(width)
    assert max(map(len, lines)) <= width
    assert not any("…" in line for line in lines)
    figures = [line.split() for line in lines[-9:]]
    assert [each[0] for each in figures] == [*SCENES, "mean"]
    assert {len(each) for each in figures} == {1 + len(METHODS)}
    words = " ".join(lines[:-9]).split()
    assert all(word in words for method in METHODS for word in method.split())


def test_names_stand_whole_where_there_is_room() -> None:
    assert all(method in printed(240)[1] for method in METHODS)
