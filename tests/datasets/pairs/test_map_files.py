"""Every way in which a map's numbers can be misread: they are read right, or refused in one line."""

from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image

from semidense.datasets import write_pfm, write_png16
from semidense.datasets.errors import DatasetError, MissingFileError
from semidense.datasets.formats.tiff import write_tiff
from semidense.datasets.pairs.map_files import Reading, _read_npy, read_map, recognised_scale

N = np.nan
TRUE = np.full((40, 120), 20.5, np.float32)
TRUE[:, :10] = N
TRUE[0, 20:30] = 61.25
"""A map as it is meant: disparities of 20.5 and 61.25 px, and a band without any."""


def save(folder: Path, name: str, stored: np.ndarray) -> Path:
    path = folder / name
    if path.suffix == ".npy":
        np.save(path, stored)
    elif stored.dtype == np.int16:
        tifffile.imwrite(path, stored)
    else:
        Image.fromarray(stored).save(path)
    return path


def as_none(value: float, scale: float = 1.0) -> np.ndarray:
    return np.where(np.isnan(TRUE), value, TRUE * scale)


def opencv(value: int = -16) -> np.ndarray:
    return as_none(value, 16).astype(np.int16)


@pytest.mark.parametrize(
    ("name", "stored", "reading"),
    [
        pytest.param("a.npy", TRUE, Reading(), id="NaN is none"),
        pytest.param("a.npy", TRUE.astype(np.float64), Reading(), id="float64"),
        pytest.param("a.npy", as_none(np.inf), Reading(), id="infinity is none"),
        pytest.param("a.npy", as_none(-np.inf), Reading(), id="minus infinity is none"),
        pytest.param("a.npy", as_none(0), Reading(), id="0 is none where the next disparity is above 1 px"),
        pytest.param("a.npy", as_none(-1), Reading(), id="the only negative number is none"),
        pytest.param("a.npy", as_none(999), Reading(none=999), id="a none that was given"),
        pytest.param("a.npy", -TRUE, Reading(scale=-1), id="the other sign"),
        pytest.param("a.npy", TRUE / 120, Reading(scale=1 / 120), id="shares of the width"),
        pytest.param("a.npy", opencv(), Reading(), id="OpenCV's 16-bit numbers"),
        pytest.param("a.npy", opencv(-33 * 16), Reading(), id="OpenCV's none for a negative range"),
        pytest.param("a.npy", opencv().astype(np.float32), Reading(scale=16), id="OpenCV's numbers, not divided"),
        pytest.param("a.png", opencv().astype(np.uint16), Reading(), id="OpenCV's none, wrapped around"),
        pytest.param("a.png", as_none(0, 256).astype(np.uint16), Reading(), id="KITTI"),
        pytest.param("a.png", as_none(0, 4).astype(np.uint8), Reading(scale=4), id="Middlebury's 8 bits"),
        pytest.param("a.tiff", TRUE, Reading(), id="float TIFF"),
        pytest.param("a.tif", as_none(0, 256).astype(np.uint16), Reading(), id="16-bit TIFF"),
        pytest.param("a.tif", opencv(), Reading(), id="OpenCV's 16-bit numbers in a TIFF"),
    ],
)
def test_it_is_read_right(name: str, stored: np.ndarray, reading: Reading, tmp_path: Path) -> None:
    found = read_map(save(tmp_path, name, stored), reading)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, TRUE, rtol=1e-6)


def test_the_projects_own_files_come_back(tmp_path: Path) -> None:
    write_pfm(tmp_path / "a.pfm", TRUE)
    write_png16(tmp_path / "a.png", TRUE)
    write_tiff(tmp_path / "a.tif", TRUE)
    for name in ("a.pfm", "a.png", "a.tif"):
        np.testing.assert_array_equal(read_map(tmp_path / name, Reading()), TRUE, err_msg=name)


def test_zero_is_a_disparity_among_others() -> None:
    """Whole disparities from 0 on, as a winner-take-all map has them."""
    stored = np.tile(np.arange(120, dtype=np.float32) % 32, (4, 1))
    path = Path("a.npy")
    assert recognised_scale(str(path), stored) == 1


def test_zero_and_negative_disparities_are_kept(tmp_path: Path) -> None:
    stored = np.tile(np.arange(120, dtype=np.float32) % 32 - 3, (4, 1))
    np.testing.assert_array_equal(read_map(save(tmp_path, "a.npy", stored), Reading()), stored)


@pytest.mark.parametrize(
    ("name", "stored", "reading", "message"),
    [
        pytest.param("a.npy", -TRUE, Reading(scale=None), "most disparities are negative.*scale=-1", id="sign"),
        pytest.param("a.npy", opencv().astype(np.float32), Reading(), "980 px .*120 px.*scale=16", id="scale"),
        pytest.param("a.npy", TRUE / 120, Reading(), "shares of the width.*scale=0.00833", id="shares of the width"),
        pytest.param("a.png", as_none(0, 4).astype(np.uint8), Reading(), "nothing of the scale", id="8 bits"),
        pytest.param("a.npy", as_none(0).astype(np.int64), Reading(), "nothing of the scale", id="64 bits"),
        pytest.param(
            "a.png", np.full((4, 120), 600, np.uint16), Reading(), r"scale=256.*scale=16.*give one", id="16 or 256"
        ),
        pytest.param("a.npy", np.full((4, 9), N), Reading(), "no pixel has a disparity", id="nothing known"),
        pytest.param("a.npy", np.zeros((4, 9), np.float32), Reading(), "all disparities are 0", id="never filled"),
        pytest.param("a.npy", as_none(1e6), Reading(), "1e.06 px in an image of 120 px.*none=", id="large none"),
        pytest.param("a.npy", np.float64([[1e300, 2, 3]]), Reading(), "1e.300 px .*other byte order", id="huge"),
        pytest.param(
            "a.npy", (TRUE * np.float32(1.013)).byteswap(), Reading(), "the file has the other byte order", id="bytes"
        ),
        pytest.param("a.npy", np.zeros((4, 9, 3)), Reading(), r"\(rows, columns\) of numbers", id="three bands"),
        pytest.param("a.npy", np.zeros((4, 9), bool), Reading(), r"\(rows, columns\) of numbers", id="a mask"),
        pytest.param("a.png", np.zeros((4, 9, 3), np.uint8), Reading(), r"\(rows, columns\)", id="a picture"),
        pytest.param("a.jpg", np.zeros((4, 9), np.uint8), Reading(), "no format of maps; give .pfm", id="JPEG"),
    ],
)  # fmt: skip
def test_it_is_refused_in_one_line(
    name: str, stored: np.ndarray, reading: Reading, message: str, tmp_path: Path
) -> None:
    from semidense.datasets.pairs.map_files import disparities, stored_map

    path = save(tmp_path, name, stored)
    with pytest.raises(DatasetError, match=message) as error:
        numbers = stored_map(path)
        scale = recognised_scale(str(path), numbers)
        disparities(str(path), numbers, Reading(scale, reading.none), signed=False)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize("name", ["a.npy", "a.tif", "a.pfm", "a.png"])
def test_what_is_no_file_of_the_format_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(MissingFileError):
        read_map(tmp_path / name, Reading())
    (tmp_path / name).write_bytes(b"no map at all")
    with pytest.raises(DatasetError, match=name):
        read_map(tmp_path / name, Reading())


@pytest.mark.parametrize("scale", [0.0, N, np.inf])
def test_a_scale_that_is_none_is_refused(scale: float) -> None:
    with pytest.raises(DatasetError, match="stored value of 1 px"):
        Reading(scale=scale)


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(b"\x93NUMPY\x01\x00\x76\x00{'shape': (1000000, ((((((" + b" " * 90 + b"\n", id="a garbled header"),
        pytest.param(b"PK\x03\x04 several arrays", id="an archive of arrays"),
        pytest.param(
            b"\x93NUMPY\x01\x00\x76\x00"
            + b"{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 1000000), }".ljust(117)
            + b"\n1234",
            id="more than there is",
        ),
    ],
)
def test_an_array_that_is_none_is_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "m.npy").write_bytes(content)
    with pytest.raises(DatasetError, match="this is not a NumPy file"):
        _read_npy(tmp_path / "m.npy")
