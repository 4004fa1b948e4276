from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semidense.datasets import open_dataset
from semidense.datasets.pairs.images import harmonised

U8, U16 = np.uint8, np.uint16


@pytest.mark.parametrize(
    ("left", "right", "expected"),
    [
        pytest.param(U8([[7]]), U8([[9]]), ([[7]], [[9]]), id="alike stays"),
        pytest.param(U8([[255]]), U16([[40000]]), ([[65535]], [[40000]]), id="8 bits become 16"),
        pytest.param(U8([[7]]), U8([[[1, 2, 3]]]), ([[[7, 7, 7]]], [[[1, 2, 3]]]), id="gray becomes colour"),
        pytest.param(U16([[[1, 2, 60000]]]), U8([[1]]), ([[[1, 2, 60000]]], [[[257, 257, 257]]]), id="both at once"),
        pytest.param(U16([[1023, 0]]), U16([[512, 1]]), ([[65535, 0]], [[32800, 64]]), id="10 bits in both together"),
        pytest.param(U16([[4095]]), U16([[100]]), ([[65535]], [[1600]]), id="12 bits in one, few in the other"),
        pytest.param(U16([[200]]), U16([[7]]), ([[51400]], [[1799]]), id="8 bits in 16 are those of 8"),
        pytest.param(U8([[128]]), U16([[2048]]), ([[32896]], [[32776]]), id="8 bits beside 12"),
        pytest.param(U16([[65520]]), U16([[16]]), ([[65520]], [[16]]), id="12 bits stored high stay"),
        pytest.param(U16([[0]]), U16([[0]]), ([[0]], [[0]]), id="black stays black"),
    ],
)
def test_views_are_brought_to_the_richer_kind(
    left: np.ndarray, right: np.ndarray, expected: tuple[object, object]
) -> None:
    made = harmonised(left, right)
    assert (made[0].tolist(), made[1].tolist()) == expected
    assert made[0].dtype == made[1].dtype


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_sensors_of_few_bits_give_the_gray_of_an_8_bit_picture(tmp_path: Path, bits: int) -> None:
    gray = np.arange(256, dtype=np.uint16).reshape(16, 16)
    stored = np.rint(gray * ((2**bits - 1) / 255)).astype(np.uint16)
    for name, view in (("l.png", stored), ("r.png", stored[::-1])):
        Image.fromarray(view).save(tmp_path / name)
    views = open_dataset(f"pair:{tmp_path}/l.png,{tmp_path}/r.png").scenes[0].load_images()
    assert np.abs(views[0] / 257 - gray).max() < 0.2
    assert np.array_equal(views[1], views[0][::-1])


def test_32_bit_tiff_of_16_bit_values(tmp_path: Path) -> None:
    for name, value in (("l.tif", 4095), ("r.tif", 0)):
        Image.fromarray(np.full((4, 4), value, np.int32)).save(tmp_path / name)
    left, right = open_dataset(f"pair:{tmp_path}/l.tif,{tmp_path}/r.tif").scenes[0].load_images()
    assert (left.dtype, left.max(), right.max()) == (np.uint16, 65535, 0)
