from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

from semidense.pipeline.execution.tiles import Rows, cut_rows, dims_of, labelled, read_block, trim
from semidense.stages.stage import NoParams, Stage

Arrays = dict[str, Any]
IMAGE = np.arange(6 * 3, dtype=np.float32).reshape(6, 3)


@pytest.mark.parametrize(
    ("height", "rows", "expected"),
    [
        pytest.param(6, 3, [(0, 3), (3, 6)], id="whole tiles"),
        pytest.param(7, 3, [(0, 3), (3, 6), (6, 7)], id="the last is lower"),
        pytest.param(2, 3, [(0, 2)], id="image lower than a tile"),
        pytest.param(1, 1, [(0, 1)], id="one row"),
    ],
)
def test_tiles_cover_every_row_once(height: int, rows: int, expected: list[tuple[int, int]]) -> None:
    tiles = cut_rows(height, rows)
    assert [(tile.start, tile.stop) for tile in tiles] == expected
    assert {tile.height for tile in tiles} == {height}


def test_a_tile_names_its_first_and_last_row() -> None:
    assert str(Rows(32, 64, 100)) == "rows 32-63"


def stage(halo: int, border: str) -> Stage:
    return Stage("p", (), (), "m:f", tile_rows=2, halo=lambda _: halo, border=border)  # type: ignore[arg-type]


@pytest.fixture
def arrays(tmp_path: Path) -> Arrays:
    group = zarr.open_group(tmp_path / "a.zarr", mode="w", zarr_format=3)
    made = {
        "map": (IMAGE, ("y", "x")),
        "volume": (np.stack([IMAGE, IMAGE + 100], axis=2), ("y", "x", "d")),
        "channels": (np.stack([IMAGE, IMAGE + 100]), ("channel", "y", "x")),
        "d": (np.array([4, 5], np.int16), ("d",)),
    }
    for name, (values, dims) in made.items():
        group.create_array(name, data=values, dimension_names=dims)
    return labelled(dict(group.arrays()))


ROWS = [Rows(0, 2, 6), Rows(2, 4, 6), Rows(4, 6, 6), Rows(0, 6, 6)]


@pytest.mark.parametrize("rows", ROWS, ids=str)
@pytest.mark.parametrize("halo", [0, 1, 5], ids="halo {}".format)
def test_cut_gives_the_rows_around_a_tile_that_there_are(arrays: Arrays, rows: Rows, halo: int) -> None:
    block = read_block(arrays, rows, stage(halo, "cut"), NoParams())
    first, last = max(0, rows.start - halo), min(6, rows.stop + halo)
    assert np.array_equal(block["map"], IMAGE[first:last])
    assert np.array_equal(block["volume"][..., 1], IMAGE[first:last] + 100)
    assert np.array_equal(block["channels"][1], IMAGE[first:last] + 100)


@pytest.mark.parametrize("rows", ROWS, ids=str)
@pytest.mark.parametrize("halo", [0, 1, 5], ids="halo {}".format)
def test_edge_gives_the_padded_image_s_rows(arrays: Arrays, rows: Rows, halo: int) -> None:
    block = read_block(arrays, rows, stage(halo, "edge"), NoParams())
    padded = np.pad(IMAGE, halo, mode="edge")[rows.start : rows.stop + 2 * halo]
    assert np.array_equal(block["map"], padded)
    assert np.array_equal(block["volume"][..., 1], padded + 100)
    assert np.array_equal(block["channels"][0], padded)


def test_the_top_left_corner_repeats_its_pixel(arrays: Arrays) -> None:
    block = read_block(arrays, Rows(0, 1, 6), stage(1, "edge"), NoParams())
    assert block["map"].tolist() == [[0, 0, 1, 2, 2], [0, 0, 1, 2, 2], [3, 3, 4, 5, 5]]


def test_what_has_no_rows_comes_whole(arrays: Arrays) -> None:
    assert read_block(arrays, ROWS[1], stage(1, "edge"), NoParams())["d"].tolist() == [4, 5]
    assert arrays["d"].dims == ("d",)


def test_an_array_without_names_has_no_dims(tmp_path: Path) -> None:
    assert dims_of(zarr.create_array(tmp_path / "b.zarr", data=IMAGE, zarr_format=3)) == ()


@pytest.mark.parametrize("rows", ROWS, ids=str)
@pytest.mark.parametrize("halo", [0, 1, 5], ids="halo {}".format)
def test_trim_gives_the_tile_s_own_rows_back(rows: Rows, halo: int) -> None:
    block = {"map": IMAGE[max(0, rows.start - halo) : min(6, rows.stop + halo)], "d": np.array([4, 5])}
    own = trim(block, {"map": ("y", "x"), "d": ("d",)}, rows, halo)
    assert np.array_equal(own["map"], IMAGE[rows.start : rows.stop])
    assert own["d"].tolist() == [4, 5]
