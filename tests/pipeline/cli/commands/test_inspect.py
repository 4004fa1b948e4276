from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from semidense.pipeline.api import Task, explain, open_store
from semidense.pipeline.cli.commands.inspect import Inspection, draw, inspection, statistics
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.results.result import Result


@pytest.fixture
def costs(trained: Result, trained_task: Task) -> Inspection:
    return inspection(explain(trained_task, "costvolume"), trained.store, trained_task)


def test_a_product_that_is_not_cached_comes_with_the_command_that_makes_it(tmp_path: Path) -> None:
    task = Task("synthetic:train=0,test=1", cache=tmp_path)
    with pytest.raises(UsageError, match=r"images of test-0 is not cached \(never made\): .*--upto images"):
        inspection(explain(task, "images"), open_store(tmp_path), task)


def test_statistics_leave_nan_out_and_count_it() -> None:
    values = np.array([[1, 2], [np.nan, 6]], np.float32)
    (row,) = statistics(xr.Dataset({"map": (("y", "x"), values, {"units": "px"})}).chunk())
    assert row == {
        "name": "map", "dims": "y 2 x x 2", "dtype": "float32", "units": "px",
        "min": 1.0, "max": 6.0, "mean": 3.0, "none": 0.25,
    }  # fmt: skip


def test_an_array_without_a_number_has_no_figures() -> None:
    (row,) = statistics(xr.Dataset({"map": (("y",), np.full(3, np.nan, np.float32))}).chunk())
    assert set(row) == {"name", "dims", "dtype", "units", "none"}
    assert row["none"] == 1.0


def test_an_empty_array_has_no_figures() -> None:
    (row,) = statistics(xr.Dataset({"map": (("y",), np.zeros(0))}))
    assert set(row) == {"name", "dims", "dtype", "units"}


def test_what_is_derived_is_not_listed(costs: Inspection) -> None:
    assert "probability" in costs.dataset
    assert [row["name"] for row in statistics(costs.dataset)] == ["cost"]


@pytest.mark.parametrize(
    ("pixel", "disparity", "message"),
    [
        pytest.param("", None, "pixel '': write Y,X", id="nothing"),
        pytest.param("12", None, "pixel '12': write Y,X such as 120,200", id="one number"),
        pytest.param("a,b", None, "write Y,X", id="no numbers"),
        pytest.param("64,0", None, "outside the image of 64 x 80 px", id="below the image"),
        pytest.param("-1,0", None, "outside the image", id="above the image"),
        pytest.param("0,80", None, "outside the image", id="right of the image"),
        pytest.param(None, 9, "disparity 9", id="a disparity the volume has not"),
    ],
)
def test_what_is_not_in_the_product_is_refused(
    costs: Inspection, tmp_path: Path, pixel: str | None, disparity: int | None, message: str
) -> None:
    with pytest.raises(UsageError, match=message) as caught:
        draw(costs, tmp_path / "p.png", pixel, disparity)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("option", [("--pixel", "nonsense"), ("--disparity", "0")], ids=lambda option: option[0])
def test_what_only_a_picture_shows_is_refused_without_one(
    invoke: Callable[..., Any], tmp_path: Path, option: tuple[str, str]
) -> None:
    ran = invoke("inspect", "costvolume", *option, "--cache", tmp_path)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err == "pipeline: --pixel and --disparity choose what is drawn into --png: add --png FILE\n"


def test_a_picture_that_cannot_be_written_is_refused(costs: Inspection, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be written"):
        draw(costs, tmp_path / "none" / "p.png", None, None)


def test_a_cost_volume_comes_with_the_cached_truth_of_its_scene(costs: Inspection, tmp_path: Path) -> None:
    assert costs.truth is not None
    assert costs.truth["disparity"].shape == costs.dataset["cost"].shape[:2]
    draw(costs, tmp_path / "p.png", "32,40", None)
    assert (tmp_path / "p.png").stat().st_size > 0
