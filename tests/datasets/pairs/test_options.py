"""A specification is read back as it was written, whatever the files are called."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from semidense.datasets import DatasetError, open_dataset
from semidense.datasets.pairs.options import PairOptions, file_names, pair_spec, parse


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


@pytest.mark.parametrize(
    ("argument", "told"),
    [
        ("l.png,r.png,foo=3", "foo is not known; known are calib, unit, d_min, "),
        ("a,b.png,r.png", "3 paths; a path with a comma stands in double quotes; write pair:LEFT,RIGHT"),
    ],
)
def test_too_many_parts_are_told(argument: str, told: str) -> None:
    with pytest.raises(DatasetError, match=f"pair:{argument}: {told}"):
        parse(argument)


def test_a_message_about_such_a_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(DatasetError) as refused:
        open_dataset(pair_spec([str(tmp_path / "two\nlines.png")] * 2, PairOptions()))
    assert "\n" not in str(refused.value)
    assert r"two\nlines.png" in str(refused.value)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        pytest.param({"d_min": "0"}, "d_min = '0': give a whole number of pixels", id="a text"),
        pytest.param({"d_max": [3]}, r"d_max = \[3\]: give a whole number", id="a list"),
        pytest.param({"d_max": True}, "d_max = True: give a whole number", id="a flag"),
        pytest.param({"d_max": 2.5}, "d_max = 2.5: give a whole number", id="half a pixel"),
        pytest.param({"scale": "16"}, "scale = '16': give a number", id="a scale as a text"),
        pytest.param({"none": "5"}, "none = '5': give a number", id="a none as a text"),
        pytest.param({"unit": "inch"}, "unit 'inch' of a calibration; give mm, cm, m", id="a unit without a file"),
        pytest.param({"unit": ["mm"]}, "unit .'mm'. of a calibration", id="a list of units"),
    ],
)
def test_values_of_another_type_are_refused_in_one_line(given: dict[str, Any], message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        PairOptions(**given)


def test_numbers_of_every_kind_are_taken_alike() -> None:
    found = PairOptions(d_min=np.int64(-3), d_max=np.float32(8), scale=256, none=np.uint8(5))  # type: ignore[arg-type]
    assert (found.d_min, found.d_max, found.scale, found.none) == (-3, 8, 256.0, 5.0)
    assert found == parse(pair_spec(["a", "b"], found).removeprefix("pair:"))[1]


@pytest.mark.parametrize("none", [np.nan, np.inf, -np.inf])
def test_nan_and_infinity_are_none_anyway(none: float) -> None:
    assert PairOptions(none=none).none is None


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        pytest.param(None, (), id="none"),
        pytest.param("a.txt", ("a.txt",), id="one"),
        pytest.param((Path("l.yaml"), "r.yaml"), ("l.yaml", "r.yaml"), id="two"),
    ],
)
def test_one_file_or_several_are_taken(given: object, expected: tuple[str, ...]) -> None:
    assert file_names(given) == expected


@pytest.mark.parametrize("given", [3, [None], {"K": 1}], ids=repr)
def test_what_is_no_file_is_refused(given: object) -> None:
    with pytest.raises(DatasetError, match=r"^calib = .*: give the path"):
        file_names(given)
