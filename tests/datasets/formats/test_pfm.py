import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from semidense.datasets.errors import DatasetError, MissingFileError, PfmError
from semidense.datasets.formats.pfm import read_pfm, write_pfm

SIX = np.array([[1, 2, 3], [4, 5, 6]], "<f4")
BOTTOM_UP = SIX[::-1].tobytes()


def save(folder: Path, content: bytes) -> Path:
    path = folder / "map.pfm"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    "header, pixels",
    [
        pytest.param(b"Pf\n3 2\n-1.0\n", BOTTOM_UP, id="little-endian"),
        pytest.param(b"Pf\n3 2\n1.0\n", SIX[::-1].astype(">f4").tobytes(), id="big-endian"),
        pytest.param(b"Pf\n3 2\n-0.003922\n", BOTTOM_UP, id="the scale's size is no factor (MiddEval3)"),
        pytest.param(b"Pf\r\n3  2 \r\n-1\r\n", BOTTOM_UP, id="written on Windows"),
    ],
)
def test_reads_rows_top_down_in_either_byte_order(tmp_path: Path, header: bytes, pixels: bytes) -> None:
    disparity = read_pfm(save(tmp_path, header + pixels))
    assert disparity.dtype == np.dtype(np.float32)
    assert disparity.dtype.isnative
    np.testing.assert_array_equal(disparity, SIX)


def test_infinity_is_unknown_and_negative_values_stay(tmp_path: Path) -> None:
    values = np.array([[np.inf, -np.inf, np.nan, -3.5]], "<f4")
    disparity = read_pfm(save(tmp_path, b"Pf\n4 1\n-1\n" + values.tobytes()))
    np.testing.assert_array_equal(disparity, [[np.nan, np.nan, np.nan, -3.5]])


def test_writes_the_bytes_that_the_format_asks_for(tmp_path: Path) -> None:
    write_pfm(tmp_path / "map.pfm", np.array([[1, np.nan], [3, 4]]))
    expected = b"Pf\n2 2\n-1.0\n" + np.array([3, 4, 1, np.inf], "<f4").tobytes()
    assert (tmp_path / "map.pfm").read_bytes() == expected
    assert [entry.name for entry in tmp_path.iterdir()] == ["map.pfm"]


@given(
    hnp.arrays(
        np.float32,
        hnp.array_shapes(min_dims=2, max_dims=2, max_side=6),
        elements=st.floats(width=32, allow_infinity=False),
    )
)
@settings(max_examples=40, deadline=None)
def test_round_trip_is_exact(tmp_path_factory: pytest.TempPathFactory, array: np.ndarray) -> None:
    path = tmp_path_factory.mktemp("pfm") / "map.pfm"
    write_pfm(path, array)
    np.testing.assert_array_equal(read_pfm(path), array)


@pytest.mark.parametrize(
    "content, message",
    [
        pytest.param(b"", "no magic line", id="empty file"),
        pytest.param(b"Pf", "no magic line", id="cut within the magic"),
        pytest.param(b"PF\n1 1\n-1\n" + bytes(12), "colour PFM", id="colour"),
        pytest.param(b"P5\n1 1\n255\n\0", "starts with 'P5'", id="a PGM"),
        pytest.param(b"\x89PNG\r\n\x1a\n" + bytes(40), "is no PFM", id="a PNG"),
        pytest.param(b"\0" * 500, "no magic line", id="zeros without a line end"),
        pytest.param(b"Pf\n3\n-1\n" + BOTTOM_UP, "two whole numbers", id="one size"),
        pytest.param(b"Pf\n3 2 1\n-1\n" + BOTTOM_UP, "two whole numbers", id="three sizes"),
        pytest.param(b"Pf\nthree 2\n-1\n" + BOTTOM_UP, "two whole numbers", id="size in words"),
        pytest.param(b"Pf\n-3 2\n-1\n" + BOTTOM_UP, "two whole numbers", id="negative size"),
        pytest.param(b"Pf\n3.0 2\n-1\n" + BOTTOM_UP, "two whole numbers", id="fractional size"),
        pytest.param("Pf\n٣ 2\n-1\n".encode() + BOTTOM_UP, "two whole numbers", id="digits outside ASCII"),
        pytest.param(b"Pf\n0 2\n-1\n", "at least 1", id="no columns"),
        pytest.param(b"Pf\n60000 60000\n-1\n", "60000 x 60000 = 3,600,000,000 pixels", id="claims gigabytes"),
        pytest.param(b"Pf\n3 2\n0\n" + BOTTOM_UP, "scale line '0'", id="scale without a sign"),
        pytest.param(b"Pf\n3 2\nnan\n" + BOTTOM_UP, "scale line 'nan'", id="scale NaN"),
        pytest.param(b"Pf\n3 2\nlittle\n" + BOTTOM_UP, "scale line 'little'", id="scale in words"),
        pytest.param(b"Pf\n3 2", "no size line", id="cut within the header"),
        pytest.param(b"Pf\n3 2\n", "no scale line", id="cut before the scale"),
        pytest.param(b"Pf\n3 2\n-1\n" + BOTTOM_UP[:-1], "truncated: 23 bytes", id="one byte short"),
        pytest.param(b"Pf\n3 2\n-1\n", "truncated: 0 bytes", id="no pixels"),
        pytest.param(b"Pf\n3 2\n-1\n" + BOTTOM_UP + b"\n", "trailing bytes: 25 bytes", id="one byte too many"),
    ],
)
def test_refuses_a_bad_file_in_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = save(tmp_path, content)
    with pytest.raises(PfmError) as caught:
        read_pfm(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["absent.pfm", "."])
def test_names_what_cannot_be_opened(tmp_path: Path, name: str) -> None:
    with pytest.raises(MissingFileError, match="cannot be read"):
        read_pfm(tmp_path / name)


@pytest.mark.parametrize(
    "array, message",
    [
        pytest.param(np.zeros((2, 3, 3)), "shape", id="colour"),
        pytest.param(np.zeros((2, 3), np.int32), "int32", id="integers"),
        pytest.param(np.zeros((0, 3)), "at least 1", id="empty"),
        pytest.param(np.full((1, 1), 1e300), "float32's largest", id="would become infinite, so unknown"),
    ],
)
def test_refuses_to_write_what_would_not_come_back(tmp_path: Path, array: np.ndarray, message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        write_pfm(tmp_path / "map.pfm", array)
    assert not list(tmp_path.iterdir())


def test_reading_does_not_depend_on_this_machine(tmp_path: Path) -> None:
    native = "<" if sys.byteorder == "little" else ">"
    path = save(tmp_path, b"Pf\n1 1\n" + (b"-1" if native == "<" else b"1") + b"\n" + np.float32(7).tobytes())
    assert read_pfm(path)[0, 0] == 7
