"""A specification is read back as it was written, whatever the files are called."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semidense.datasets import DatasetError, open_dataset
from semidense.datasets.pairs.options import PairOptions, pair_spec, parse


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("a,b.png", id="a comma"),
        pytest.param('say "cheese".png', id="quotes"),
        pytest.param("two\nlines.png", id="a line break"),
        pytest.param("dos\r\nlines.png", id="a line break of Windows"),
        pytest.param("calib=1.png", id="reads as an option"),
        pytest.param("d_max=7", id="reads as a number"),
        pytest.param("split=side-by-side", id="reads as a split"),
        pytest.param(" spaces .png", id="spaces"),
        pytest.param("x=1.png", id="a sign that is no option"),
    ],
)
def test_any_name_of_a_file_survives(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Image.fromarray(np.zeros((4, 5), np.uint8)).save(tmp_path / name, "PNG")
    options = PairOptions((name,), "mm", -3, 3)
    sides, found = parse(pair_spec([name, name], options).removeprefix("pair:"))
    assert found == options
    (scene,) = open_dataset(pair_spec([name, name], PairOptions(d_min=-3, d_max=3))).scenes
    assert scene.files["left"].samefile(tmp_path / name)
    assert len(sides) == 2


def test_a_message_about_such_a_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(DatasetError) as refused:
        open_dataset(pair_spec([str(tmp_path / "two\nlines.png")] * 2, PairOptions()))
    assert "\n" not in str(refused.value)
    assert r"two\nlines.png" in str(refused.value)
