from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from semidense.datasets.errors import DatasetError, ImageError, MissingFileError, Png16Error
from semidense.datasets.formats.png16 import read_png16, write_png16


def test_value_over_256_and_zero_is_none(tmp_path: Path) -> None:
    Image.fromarray(np.array([[0, 1, 256, 65535]], np.uint16)).save(tmp_path / "d.png")
    disparity = read_png16(tmp_path / "d.png")
    assert disparity.dtype == np.float32
    np.testing.assert_array_equal(disparity, np.array([[np.nan, 1 / 256, 1, 65535 / 256]], np.float32))


def test_writes_rounded_steps_and_keeps_a_known_zero_known(tmp_path: Path) -> None:
    write_png16(tmp_path / "d.png", np.array([[np.nan, 0.0, 0.5, 1 + 1 / 1024]]))
    stored = np.array(Image.open(tmp_path / "d.png"))
    assert stored.dtype == np.uint16
    assert stored.tolist() == [[0, 1, 128, 256]]
    assert [entry.name for entry in tmp_path.iterdir()] == ["d.png"]


@given(
    hnp.arrays(
        np.float32,
        hnp.array_shapes(min_dims=2, max_dims=2, max_side=6),
        elements=st.one_of(st.floats(0.00390625, 255.75, width=32), st.just(np.float32(np.nan))),
    )
)
@settings(max_examples=40, deadline=None)
def test_round_trip_is_within_half_a_step(tmp_path_factory: pytest.TempPathFactory, disparity: np.ndarray) -> None:
    path = tmp_path_factory.mktemp("png16") / "d.png"
    write_png16(path, disparity)
    np.testing.assert_allclose(read_png16(path), disparity, rtol=0, atol=1 / 512)


@pytest.mark.parametrize(
    "array, message",
    [
        pytest.param(np.array([[256.0]]), "holds 0 to", id="above the largest"),
        pytest.param(np.array([[-0.5]]), "holds 0 to", id="negative"),
        pytest.param(np.array([[np.inf]]), "holds 0 to", id="infinite"),
        pytest.param(np.zeros((2, 2), np.int16), "int16", id="integers"),
        pytest.param(np.zeros((2, 2, 1)), "rows, columns", id="three dimensions"),
        pytest.param(np.zeros((2, 0)), "at least 1", id="empty"),
    ],
)
def test_refuses_to_write_what_the_format_cannot_hold(tmp_path: Path, array: np.ndarray, message: str) -> None:
    with pytest.raises(Png16Error, match=message):
        write_png16(tmp_path / "d.png", array)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "content, kind",
    [
        pytest.param(np.zeros((2, 2), np.uint8), Png16Error, id="8-bit gray: scaled, not KITTI's"),
        pytest.param(np.zeros((2, 2, 3), np.uint8), Png16Error, id="colour"),
        pytest.param(b"\x89PNG", ImageError, id="cut off"),
        pytest.param(None, MissingFileError, id="absent"),
    ],
)
def test_refuses_another_file_in_one_line(
    tmp_path: Path, content: np.ndarray | bytes | None, kind: type[DatasetError]
) -> None:
    path = tmp_path / "d.png"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        Image.fromarray(content).save(path)
    with pytest.raises(kind) as caught:
        read_png16(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
