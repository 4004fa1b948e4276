"""The files of a comparison, and its tables in terminals of different widths."""

import io
import re
from collections.abc import Sequence
from pathlib import Path

import pytest
from rich.console import Console

from semidense.cache import Store
from semidense.pipeline.comparison import files
from semidense.pipeline.comparison.ablation import ABLATION
from semidense.pipeline.comparison.experiments import Comparison
from semidense.pipeline.comparison.methods import LOWERED, MATCHERS
from semidense.pipeline.comparison.tables import _DENSITY, _SPARE, _by_scene, _density_table
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.plan import Plan
from semidense.pipeline.results.metric_rows import FIGURES, METHOD
from semidense.pipeline.results.result import Result
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


@pytest.mark.parametrize("width", [60, 80, 100, 240])
@pytest.mark.parametrize("methods", [FEW, METHODS], ids=["few methods", "all"])
def test_nothing_is_cut(width: int, methods: Sequence[str]) -> None:
    lines = printed(width, methods)
    assert max(map(len, lines)) <= width
    assert not any("…" in line for line in lines)
    words = " ".join(lines).split()
    assert all(word in words for name in (*methods, *SCENES, "mean") for word in name.split())


def test_the_mean_is_in_the_first_part_of_a_table_in_parts() -> None:
    lines = printed(60)
    assert lines[1].split()[:2] == ["method", "mean"]
    assert sum(line.startswith("method") for line in lines) > 1


@pytest.mark.parametrize(
    ("width", "left_out"),
    [
        pytest.param(60, ["A50 px", "A90 px", "A95 px", "avgerr px", "A99 px"], id="60"),
        pytest.param(80, ["A50 px", "A90 px"], id="80"),
        pytest.param(240, [], id="240"),
    ],
)
def test_semi_dense_maps_lose_columns_by_priority(width: int, left_out: list[str]) -> None:
    figures = {name: 10.25 + place for place, name in enumerate(_DENSITY)}
    means = [{"scene": "mean of 8", "method": method, **figures} for method in MATCHERS]
    console = Console(file=io.StringIO(), width=width)
    print_table(_density_table(means), console, _SPARE)
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    assert max(map(len, shown.splitlines())) <= width
    kept = [f"{value:.2f}" for name, value in figures.items() if FIGURES[name].head not in left_out]
    whole = [line.split()[-len(kept) :] for line in shown.splitlines() if "10.25" in line]
    assert whole == [kept] * len(MATCHERS)
    assert (f"left out at this width: {', '.join(left_out)}" in " ".join(shown.split())) == bool(left_out)


def test_more_methods_than_scenes_go_down_and_fewer_across() -> None:
    assert figures(printed(240)) == [len(SCENES) + 1] * len(METHODS)
    assert figures(printed(240, FEW)) == [len(FEW)] * (len(SCENES) + 1)


def test_names_stand_whole_where_there_is_room() -> None:
    lines = printed(240)
    assert all(any(line.startswith(method) for line in lines) for method in METHODS)
    assert all(method in printed(240, FEW)[1] for method in FEW)


def comparison(experiment: str, store: Store) -> Comparison:
    """A comparison with one row of one experiment."""
    figures = {"pixels": 9, "raw_bad": 20.0, "auc": 0.1, "bad": 2.0, "invalid": 30.0}
    row = {"scene": "Teddy", "method": METHOD, "mask": "nonocc", "threshold_px": 1.0, "experiment": experiment}
    return Comparison([row | figures], [], (), Result(Plan((), ()), {}, store, []))


def test_a_folder_is_used_again_by_other_experiments(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "sheets", lambda _: {})
    for experiment in ("raw", "auc", "raw"):
        written = files.write_comparison(comparison(experiment, Store(tmp_path / "cache")), tmp_path / "out")
        assert {path.name for path in written} == {"comparison.csv", "comparison.json", f"{experiment}.png"}
        assert set(written) == set((tmp_path / "out").iterdir())


def test_a_picture_of_somebody_else_is_refused_before_anything_is_computed(tmp_path: Path) -> None:
    (tmp_path / "raw.png").write_text("mine")
    files.require_comparison_place(tmp_path, ["auc"])
    with pytest.raises(UsageError, match=r"raw\.png: this file was not written by an earlier command"):
        files.require_comparison_place(tmp_path, ["raw"])
