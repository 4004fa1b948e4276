import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from semidense.pipeline.api import Task, planned, sweep_request
from semidense.pipeline.cli.console import print_sweep
from semidense.pipeline.files.run_files import write_sweep
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.results.result import Result
from tests.tiny import TRAINED

Invoke = Callable[..., Any]


@pytest.fixture
def rows(trained: Result) -> list[dict[str, object]]:
    """The rows of a run as those of a sweep over two thresholds."""
    return [row | {"R": R, "invalid": 100 * R, "bad": 10 * (1 - R)} for R in (0.25, 0.75) for row in trained.metrics]


def test_the_table_has_every_row(rows: list[dict[str, object]], tmp_path: Path) -> None:
    table, picture, _ = write_sweep(rows, tmp_path / "new" / "folder")
    written = list(csv.DictReader(table.read_text().splitlines()))
    assert len(written) == len(rows)
    assert [float(row["R"]) for row in written] == [row["R"] for row in rows]
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_dry_run_plans_every_value_and_makes_nothing(trained_task: Task, trained: Result) -> None:
    request = sweep_request(trained_task, "0.31,0.32", ["semidense.calibrated=false"])
    plan = planned(trained_task, request)
    assert [each.step.R for each in plan.todo() if each.step.product == "semidense"] == [0.31, 0.32]
    assert planned(trained_task, request).todo() == plan.todo()


def test_notes_are_printed_and_a_missing_picture_is_told(invoke: Invoke, trained_task: Task, tmp_path: Path) -> None:
    shared = [*TRAINED, "--cache", trained_task.cache, "-o", tmp_path / "out"]
    ran = invoke("sweep", *shared, "--set", "semidense.density=0.5", "--set", "refined.tolerance=1,2")
    assert ran.code == 0, ran.err
    assert "note: refined.tolerance changes nothing here" in ran.err
    assert "note: no sweep.png: R does not decide here" in ran.err
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"sweep.csv", "sweep.json"}


def test_without_a_pixel_kept_there_is_no_picture(rows: list[dict[str, object]], tmp_path: Path) -> None:
    write_sweep(rows, tmp_path)
    nothing = [{name: value for name, value in row.items() if name != "bad"} for row in rows]
    assert write_sweep(nothing, tmp_path) == [tmp_path / "sweep.csv", tmp_path / "sweep.json"]
    assert not (tmp_path / "sweep.png").exists(), "not the one of an earlier sweep"


def test_where_something_else_than_a_threshold_decides_there_is_no_picture(
    rows: list[dict[str, object]], tmp_path: Path
) -> None:
    wished = [{name: value for name, value in row.items() if name != "R"} for row in rows]
    assert write_sweep(wished, tmp_path) == [tmp_path / "sweep.csv", tmp_path / "sweep.json"]


def test_a_line_says_which_settings_it_is_of(rows: list[dict[str, object]], capsys: pytest.CaptureFixture[str]) -> None:
    wishes = ("semidense.max_error=0.01", "semidense.max_error=0.1")
    print_sweep([row | {"variant": f"semidense.R=0.9, {wish}"} for wish in wishes for row in rows[:4]], {})
    out = capsys.readouterr().out
    assert all(wish in out for wish in wishes) and "semidense.R" not in out
    print_sweep([row | {"variant": f"semidense.R={row['R']}"} for row in rows], {})
    assert "settings" not in capsys.readouterr().out


def test_a_folder_that_cannot_be_written_is_refused(rows: list[dict[str, object]], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="cannot be written"):
        write_sweep(rows, tmp_path / "file" / "folder")


def test_one_line_a_threshold_is_printed(rows: list[dict[str, object]], capsys: pytest.CaptureFixture[str]) -> None:
    print_sweep(rows, {"test-0": "exact"})
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [line[:3] for line in lines if line[0] == "test-0"] == [["test-0", "1", "0.25"], ["test-0", "1", "0.75"]]


def test_of_several_scenes_the_mean_is_printed(
    rows: list[dict[str, object]], capsys: pytest.CaptureFixture[str]
) -> None:
    print_sweep([*rows, *(row | {"scene": "other"} for row in rows)], {})
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [line[:3] for line in lines if line[0] == "mean"] == [["mean", "of", "2"]] * 2
    assert not [line for line in lines if line[0] == "test-0"]
