import csv
import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semidense.pipeline.figures.drawing import new_figure
from semidense.pipeline.files.writing import save_png, table_text, write_rgb
from semidense.pipeline.plan.errors import UsageError


def test_colours_come_back_pixel_by_pixel(tmp_path: Path) -> None:
    rgb = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    write_rgb(rgb, tmp_path / "a.png")
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), rgb)


def test_a_figure_replaces_the_file_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("old")
    save_png(new_figure("any"), tmp_path / "a.png")
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
    assert Image.open(tmp_path / "a.png").format == "PNG"


def test_a_figure_that_cannot_be_drawn_leaves_the_old_file(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("old")
    figure = new_figure("any")
    figure.text(0, 0, "$\\nonsense{$")
    with pytest.raises(ValueError, match="nonsense"):
        save_png(figure, tmp_path / "a.png")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_a_place_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match=r"file/a\.png: cannot be written \(Not a directory\)") as refused:
        save_png(new_figure("any"), tmp_path / "file" / "a.png")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", ["=1+1", "+1", "-x", "@cell", "\t=1", "\r=1"])
def test_no_cell_is_a_formula_to_a_spreadsheet(name: str) -> None:
    (_, row) = csv.reader(io.StringIO(table_text([{"scene": name, "R": -0.5, "more": 1}], ("scene", "R")), newline=""))
    assert row == [f"'{name}".replace("\r", " "), "-0.5"]


def test_other_texts_stay_as_they_are_in_a_table() -> None:
    assert table_text([{"scene": "Teddy", "bad": 1.5}], ("scene", "bad")) == "scene,bad\nTeddy,1.5\n"
