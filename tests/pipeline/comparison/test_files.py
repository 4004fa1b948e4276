"""The tables of a comparison in terminals of different widths."""

import io
import re
from collections.abc import Sequence

import pytest
from rich.console import Console

from semidense.pipeline.comparison.ablation import ABLATION
from semidense.pipeline.comparison.methods import LOWERED, MATCHERS
from semidense.pipeline.comparison.tables import _by_scene
from semidense.pipeline.results.metric_rows import METHOD
from semidense.pipeline.results.text import print_table

SCENES = ("Motorcycle", "MotorcycleE", "Piano", "PianoL", "Pipes", "Playroom", "Shelves", "Teddy")
METHODS = (f"{METHOD}, shipped weights", *MATCHERS, LOWERED, *ABLATION)
FEW = METHODS[:3]


def printed(width: int, methods: Sequence[str] = METHODS) -> list[str]:
    rows = [{"scene": scene, "method": method, "raw_bad": 20.123} for scene in SCENES for method in methods]
    means = [{"scene": "mean of 8", "method": method, "raw_bad": 20.1} for method in methods]
    console = Console(file=io.StringIO(), width=width)
    print_table(_by_scene(rows, means, "raw", "raw_bad"), console)
    return console.file.getvalue().splitlines()  # type: ignore[attr-defined, no-any-return]


def figures(lines: Sequence[str]) -> list[int]:
    """Return how many figures stand on each line that has some."""
    counts = [sum(re.fullmatch(r"20\.1[02]", word) is not None for word in line.split()) for line in lines]
    return [count for count in counts if count]


@pytest.mark.parametrize("width", [100, 240])
@pytest.mark.parametrize("methods", [FEW, METHODS], ids=["few methods", "all"])
def test_nothing_is_cut(width: int, methods: Sequence[str]) -> None:
    lines = printed(width, methods)
    assert max(map(len, lines)) <= width
    assert not any("…" in line for line in lines)
    words = " ".join(lines).split()
    assert all(word in words for name in (*methods, *SCENES, "mean") for word in name.split())


def test_more_methods_than_scenes_go_down_and_fewer_across() -> None:
    assert figures(printed(240)) == [len(SCENES) + 1] * len(METHODS)
    assert figures(printed(240, FEW)) == [len(FEW)] * (len(SCENES) + 1)


def test_names_stand_whole_where_there_is_room() -> None:
    lines = printed(240)
    assert all(any(line.startswith(method) for line in lines) for method in METHODS)
    assert all(method in printed(240, FEW)[1] for method in FEW)
