import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from semidense.datasets import ImageError
from semidense.datasets.formats.tiff import read_tiff, write_tiff

VALUES = np.array([[0.1, np.nan, -7.25], [np.pi, 1e-30, 65504.123]], np.float32)


def test_independent_readers_get_the_same_bits(tmp_path: Path) -> None:
    write_tiff(tmp_path / "a.tif", VALUES, {"unit": "px"})
    for read in (tifffile.imread(tmp_path / "a.tif"), cv2.imread(str(tmp_path / "a.tif"), cv2.IMREAD_UNCHANGED)):
        assert read.dtype == np.float32
        assert np.array_equal(read, VALUES, equal_nan=True)
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        assert json.loads(file.pages[0].tags["ImageDescription"].value) == {"unit": "px"}


@pytest.mark.parametrize("bad", [np.zeros((2, 2), int), np.zeros((2, 2, 3)), np.zeros((0, 2))])
def test_what_is_no_map_is_refused_and_leaves_nothing(tmp_path: Path, bad: np.ndarray) -> None:
    with pytest.raises(ImageError):
        write_tiff(tmp_path / "a.tif", bad)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("values", "byte_order"),
    [
        pytest.param(np.int16([[-16, 0, 32767], [-32768, 1, 7]]), "<", id="16 bits with a sign"),
        pytest.param(np.int16([[-16, 0, 32767], [-32768, 1, 7]]), ">", id="16 bits with a sign, big-endian"),
        pytest.param(np.uint16([[0, 65520, 65535]]), "<", id="16 bits without a sign"),
        pytest.param(np.int32([[-16, 0, 70000]]), "<", id="32 bits with a sign"),
    ],
)
def test_whole_numbers_keep_their_type(tmp_path: Path, values: np.ndarray, byte_order: str) -> None:
    tifffile.imwrite(tmp_path / "map.tif", values, byteorder=byte_order)
    found = read_tiff(tmp_path / "map.tif")
    assert found.dtype == values.dtype
    np.testing.assert_array_equal(found, values)


@pytest.mark.parametrize(
    ("values", "options"),
    [
        pytest.param(np.int8([[9, -1, -7]]), {}, id="a sign"),
        pytest.param(np.uint8([[9, 1, 7]]), {"photometric": "miniswhite"}, id="white as 0"),
    ],
)
def test_values_that_would_come_back_as_others_are_refused(
    tmp_path: Path, values: np.ndarray, options: dict[str, str]
) -> None:
    tifffile.imwrite(tmp_path / "map.tif", values, **options)
    with pytest.raises(ImageError, match="8 bits with a sign, or white as 0"):
        read_tiff(tmp_path / "map.tif")
