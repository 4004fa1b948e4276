"""Names and values of calibrations: none is given twice, since nothing tells which of its values is right."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from semidense.datasets import CalibrationError
from semidense.datasets.formats.calibration.markup import json_values, lower, markup_values, xml_values, yaml_values
from semidense.datasets.formats.calibration.reading import read_cameras

FILE = Path("c.yml")


@pytest.mark.parametrize(
    ("read", "text"),
    [
        pytest.param(json_values, '{"fx": 1, "fx": 2}', id="JSON"),
        pytest.param(json_values, '{"left": {"fx": 1, "fx": 1}}', id="JSON, inside"),
        pytest.param(yaml_values, "fx: 1\nfx: 2\n", id="YAML"),
        pytest.param(yaml_values, "left:\n  fx: 1\n  fx: 1\n", id="YAML, inside"),
        pytest.param(markup_values, "%YAML:1.0\n---\nfx: 1\nfx: 2\n", id="OpenCV's YAML"),
        pytest.param(markup_values, "<a><fx>1</fx><fx>2</fx></a>", id="OpenCV's XML"),
    ],
)
def test_a_name_is_given_once(read: Callable[[Path, str], dict[str, Any]], text: str) -> None:
    with pytest.raises(CalibrationError, match=r"c\.yml: .*fx is given twice") as refused:
        read(FILE, text)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("read", "text", "expected"),
    [
        pytest.param(yaml_values, "a: {x: 1}\nb: {x: 2}\n", {"a": {"x": 1}, "b": {"x": 2}}, id="of two mappings"),
        pytest.param(
            yaml_values,
            "a: &a {x: 1}\nb: {<<: *a, x: 2}\n",
            {"a": {"x": 1}, "b": {"x": 2}},
            id="a value that replaces a merged one",
        ),
        pytest.param(xml_values, "<a><P><rows>3</rows></P><Q><rows>3</rows></Q></a>", {"P": [], "Q": []}, id="XML"),
    ],
)
def test_names_of_different_places_may_be_alike(
    read: Callable[[Path, str], dict[str, Any]], text: str, expected: dict[str, Any]
) -> None:
    assert read(FILE, text) == expected


def test_parts_may_share_a_name_if_they_agree() -> None:
    assert lower("a and b", {"FX": 1, "cx": [2]}, {"fx": 1}) == {"fx": 1, "cx": [2]}
    assert list(lower("a", {"fx": float("nan")})) == ["fx"], "it is given once; that it is no number is told later"
    with pytest.raises(CalibrationError, match="a and b: CX is given twice, with different values"):
        lower("a and b", {"cx": [2]}, {"CX": [3]})


def test_two_files_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    files = [tmp_path / "a.json", tmp_path / "b.json"]
    for file, baseline in zip(files, (0.12, 0.24), strict=True):
        file.write_text(f'{{"fx": 600, "cx": 320, "cy": 240, "baseline": {baseline}, "unit": "m"}}')
    assert read_cameras([files[0]] * 2).calibration.baseline == pytest.approx(120)
    with pytest.raises(CalibrationError, match=r"a\.json and .*b\.json: baseline is given twice, with different"):
        read_cameras(files)
