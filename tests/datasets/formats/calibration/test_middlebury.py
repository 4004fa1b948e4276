from dataclasses import replace
from pathlib import Path

import pytest

from semidense.datasets.errors import CalibrationError, MissingFileError
from semidense.datasets.formats.calibration.middlebury import read_calib
from semidense.datasets.formats.calibration.reading import read_cameras
from semidense.datasets.scene import Calibration

GOOD = {
    "cam0": "[994.978 0 311.193; 0 994.978 254.877; 0 0 1]",
    "cam1": "[994.978 0 342.279; 0 994.978 254.877; 0 0 1]",
    "doffs": "31.086",
    "baseline": "193.001",
    "width": "741",
    "height": "500",
    "ndisp": "70",
}


def save(folder: Path, entries: dict[str, str]) -> Path:
    path = folder / "calib.txt"
    path.write_text("".join(f"{name}={value}\n" for name, value in entries.items()))
    return path


def test_reads_what_is_published(tmp_path: Path) -> None:
    calib = read_calib(save(tmp_path, GOOD))
    assert calib.calibration == Calibration(focal=994.978, baseline=193.001, doffs=31.086, centre=(311.193, 254.877))
    assert calib.size == (500, 741)
    assert calib.ndisp == 70


def test_spaces_blank_lines_and_other_names_do_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "calib.txt"
    path.write_text("\n".join(f"  {name} = {value} \r" for name, value in GOOD.items()) + "\n\n isint= 0\nvmin=x\n")
    assert read_calib(path) == read_calib(save(tmp_path, GOOD))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_byte_order_mark_and_comments_do_not_matter(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "calib.txt"
    lines = "".join(f"{name}={value}  # für {name}\n" for name, value in GOOD.items())
    path.write_text(f"# Kalibrierung\n{lines}", encoding=encoding)
    assert read_calib(path) == read_calib(save(tmp_path, GOOD))


def test_the_focal_length_along_y_and_skew_are_read(tmp_path: Path) -> None:
    squeezed = dict.fromkeys(("cam0", "cam1"), "[360 2 112; 0 270 93; 0 0 1]")
    found = read_calib(save(tmp_path, {**GOOD, **squeezed, "doffs": "0"}))
    assert found.calibration == Calibration(360, 193.001, 0, (112, 93), focal_y=270, skew=2)
    assert found.warnings == ()


@pytest.mark.parametrize(
    ("change", "numbers"),
    [
        pytest.param({"doffs": "35"}, ("35", "31.086"), id="doffs"),
        pytest.param({"cam1": "[994.978 0 342.279; 0 994.978 256; 0 0 1]"}, ("254.877", "256"), id="rows"),
    ],
)
def test_a_file_that_contradicts_itself_says_so(
    tmp_path: Path, change: dict[str, str], numbers: tuple[str, str]
) -> None:
    (warning,) = read_calib(save(tmp_path, {**GOOD, **change})).warnings
    assert all(number in warning for number in numbers)


@pytest.mark.parametrize("name", [name for name in GOOD if name != "cam1"])
def test_names_a_missing_entry(tmp_path: Path, name: str) -> None:
    path = save(tmp_path, {key: value for key, value in GOOD.items() if key != name})
    with pytest.raises(CalibrationError, match=rf"no line {name}=\.\.\.; expected"):
        read_calib(path)


@pytest.mark.parametrize(
    "lacking",
    [
        pytest.param(["ndisp"], id="no ndisp"),
        pytest.param(["width", "height", "ndisp"], id="no size"),
        pytest.param(["doffs", "width", "height", "ndisp"], id="cameras and baseline alone"),
        pytest.param(["cam1"], id="one camera and doffs"),
    ],
)
def test_a_calibration_of_ones_own_may_lack_what_depth_does_not_need(tmp_path: Path, lacking: list[str]) -> None:
    path = save(tmp_path, {key: value for key, value in GOOD.items() if key not in lacking})
    found = read_cameras([path])
    assert replace(found.calibration, doffs=31.086) == read_calib(save(tmp_path, GOOD)).calibration
    assert found.calibration.doffs == pytest.approx(31.086)
    assert (found.size, found.ndisp) == (
        None if "width" in lacking else (500, 741),
        None if "ndisp" in lacking else 70,
    )


def test_a_size_needs_both_sides(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="no line height"):
        read_cameras([save(tmp_path, {key: value for key, value in GOOD.items() if key != "height"})])


@pytest.mark.parametrize(
    "name, value, line",
    [
        pytest.param("cam0", "[1 0 0; 0 1 0]", 1, id="two rows"),
        pytest.param("cam0", "[1 0; 0 1; 0 0]", 1, id="two columns"),
        pytest.param("cam0", "1 0 0; 0 1 0; 0 0 1", 1, id="no brackets"),
        pytest.param("cam0", "[f 0 0; 0 f 0; 0 0 1]", 1, id="matrix in words"),
        pytest.param("cam0", "[0 0 0; 0 0 0; 0 0 1]", 1, id="no focal length"),
        pytest.param("cam0", "[nan 0 0; 0 1 0; 0 0 1]", 1, id="focal length NaN"),
        pytest.param("doffs", "inf", 3, id="infinite doffs"),
        pytest.param("doffs", "near", 3, id="doffs in words"),
        pytest.param("baseline", "0", 4, id="cameras in one place"),
        pytest.param("baseline", "-193", 4, id="negative baseline"),
        pytest.param("width", "741.5", 5, id="fractional width"),
        pytest.param("height", "0", 6, id="no rows"),
        pytest.param("ndisp", "-1", 7, id="negative ndisp"),
    ],
)
def test_names_the_line_of_an_invalid_entry(tmp_path: Path, name: str, value: str, line: int) -> None:
    path = save(tmp_path, {**GOOD, name: value})
    with pytest.raises(CalibrationError) as caught:
        read_calib(path)
    assert str(caught.value).startswith(f"{path}, line {line}: {name}={value}; expected ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "content, message",
    [
        pytest.param(b"", "no line cam0", id="empty file"),
        pytest.param(b"cam0\n", "line 1: 'cam0'; expected name=value", id="no sign"),
        pytest.param(b"cam0=\n", "expected name=value", id="no value"),
        pytest.param(b"=5\n", "expected name=value", id="no name"),
        pytest.param(b"doffs=1\n\ndoffs=2\n", "line 3: doffs is given twice, first in line 1", id="given twice"),
        pytest.param(b"\x89PNG\r\n", "not plain text", id="a PNG"),
        pytest.param(b"a=1\n" * 100000, "more than 262,144 bytes", id="too long"),
    ],
)
def test_refuses_what_is_no_calib(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "calib.txt"
    path.write_bytes(content)
    with pytest.raises(CalibrationError) as caught:
        read_calib(path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_names_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="cannot be read"):
        read_calib(tmp_path / "calib.txt")
