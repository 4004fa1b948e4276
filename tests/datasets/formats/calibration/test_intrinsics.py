from dataclasses import replace
from pathlib import Path

import pytest

from semidense.datasets import Calibration, CalibrationError
from semidense.datasets.formats.calibration.reading import read_cameras


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("754.668 0.0 489.4 0.0 754.668 265.2 0.0 0.0 1.0\n0.063\n", id="K in one line"),
        pytest.param("754.668 0 489.4\n0 754.668 265.2\n0 0 1\n0.063", id="K in three lines"),
        pytest.param("# K\n754.668 0 489.4 0 754.668 265.2 0 0 1\n0.063  # m", id="comments"),
        pytest.param("754.668, 0, 489.4, 0, 754.668, 265.2, 0, 0, 1\r\n0.063\r\n", id="commas"),
    ],
)
def test_nine_numbers_and_a_baseline_in_metres(tmp_path: Path, text: str) -> None:
    (tmp_path / "K.txt").write_text(text, newline="")
    known = read_cameras([tmp_path / "K.txt"]).calibration
    assert replace(known, baseline=63) == Calibration(754.668, 63, 0, (489.4, 265.2))
    assert known.baseline == pytest.approx(63)
    assert read_cameras([tmp_path / "K.txt"], "cm").calibration.baseline == pytest.approx(0.63)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        pytest.param("1 0 0 0 1 0 0 0 1", "9 numbers; expected nine of the camera matrix", id="no baseline"),
        pytest.param("1 0 0 0 1 0 0 0 1 -2", "a baseline of -2; expected a number of metres, above 0", id="negative"),
        pytest.param("1 0 0 0 1 0 0 0 1 nan", r"K\.txt: a baseline of nan", id="a baseline that is no number"),
        pytest.param("1 0 0 0 1 0 0 0 1 inf", r"K\.txt: a baseline of inf", id="an infinite baseline"),
        pytest.param("5 0 0 0 5 0 3 2 1 2", "not .fx s cx; 0 fy cy; 0 0 1.; is it transposed", id="as MATLAB has it"),
        pytest.param("5 0 3 0 5 2 0 0 2 2", "not .fx s cx; 0 fy cy; 0 0 1.", id="another last row"),
        pytest.param("1 0 0 0 1 0 0 0 nan 2", "the camera matrix is no matrix", id="not a number"),
    ],
)  # fmt: skip
def test_other_numbers_are_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "K.txt").write_text(text)
    with pytest.raises(CalibrationError, match=message):
        read_cameras([tmp_path / "K.txt"])


@pytest.mark.parametrize(
    ("baseline", "unit", "warned"),
    [
        pytest.param(0.12, None, False, id="12 cm"),
        pytest.param(120, "mm", False, id="12 cm in millimetres"),
        pytest.param(120, None, True, id="120 m"),
        pytest.param(0.12, "mm", True, id="a tenth of a millimetre"),
    ],
)
def test_a_baseline_that_looks_like_a_wrong_unit_is_told(
    tmp_path: Path, baseline: float, unit: str | None, warned: bool
) -> None:
    (tmp_path / "K.txt").write_text(f"500 0 311 0 500 250 0 0 1 {baseline}")
    found = read_cameras([tmp_path / "K.txt"], unit)
    assert len(found.warnings) == warned
    assert all(f"stand {found.calibration.baseline:g} mm apart" in warning for warning in found.warnings)
