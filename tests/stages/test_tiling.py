"""The helper itself: a stage whose halo is too small must be caught, in both kinds of border."""

import numpy as np
import pytest

from semidense.stages.stage import Border, Inputs, NoParams, Output, Stage
from tests.stages.tiling import same, tiled, whole

IMAGE = {"images": {"left": np.arange(35.0).reshape(7, 5) ** 2, "gain": np.array([2.0])}}
DIMS = {"images": {"left": ("y", "x"), "gain": ("band",)}}


def box_cut(_: NoParams, inputs: Inputs) -> dict[str, np.ndarray]:
    padded = np.pad(inputs["images"]["left"], ((1, 1), (0, 0)))
    return {"sum": inputs["images"]["gain"] * (padded[:-2] + padded[1:-1] + padded[2:])}


def box_edge(_: NoParams, inputs: Inputs) -> dict[str, np.ndarray]:
    block = inputs["images"]["left"]
    return {"sum": inputs["images"]["gain"] * (block[:-2] + block[1:-1] + block[2:])[:, 1:-1]}


def _stage(border: Border, halo: int) -> Stage:
    output = Output("sum", ("y", "x"), "float64", "1", "three rows")
    return Stage(
        "sum", ("images",), (output,), f"{__name__}:box_{border}", tile_rows=2, halo=lambda _: halo, border=border
    )


@pytest.mark.parametrize("rows", [1, 2, 3, 7, 100])
@pytest.mark.parametrize("border", ["cut", "edge"])
def test_tiles_equal_the_whole_with_the_right_halo(border: Border, rows: int) -> None:
    stage = _stage(border, halo=1)
    assert same(tiled(stage, NoParams(), IMAGE, DIMS, rows), whole(stage, NoParams(), IMAGE, DIMS))


def test_tiles_differ_from_the_whole_without_it() -> None:
    stage = _stage("cut", halo=0)
    assert not same(tiled(stage, NoParams(), IMAGE, DIMS, 2), whole(stage, NoParams(), IMAGE, DIMS))


def test_edge_blocks_repeat_the_nearest_pixel() -> None:
    made = whole(_stage("edge", halo=1), NoParams(), {"images": {"left": np.eye(2), "gain": np.ones(1)}}, DIMS)
    assert made["sum"].tolist() == [[2, 1], [1, 2]]
