import numpy as np
import pytest
from numpy.typing import NDArray

from semidense.stages.stage import StageError
from semidense.stages.transforms.shift import shifted_rows


def zeros(length: int) -> NDArray[np.float32]:
    return np.zeros(length, np.float32)


def noise(height: int, width: int) -> NDArray[np.uint8]:
    return np.random.default_rng(0).integers(0, 256, (height, width), np.uint8)


@pytest.mark.parametrize("offset", [pytest.param(3, id="up"), pytest.param(-2, id="down"), pytest.param(0, id="not")])
def test_a_whole_offset_copies_rows(offset: int) -> None:
    view = noise(9, 5)
    made = shifted_rows(view, np.full(9, offset, np.float32), zeros(5))
    np.testing.assert_array_equal(made, view[np.clip(np.arange(9) + offset, 0, 8)])


def test_between_rows_a_parabola_comes_out_exactly_inside_the_image() -> None:
    """The spline reproduces polynomials of the second degree."""
    y = np.arange(12.0)
    view = np.rint(2 * (y - 6) ** 2).astype(np.uint8)[:, None].repeat(3, axis=1)
    columns = np.float32([0.5, -0.5, 0.25])
    made = shifted_rows(view, zeros(12), columns)
    np.testing.assert_array_equal(made[3:9], np.rint(2 * (y[3:9, None] + columns - 6) ** 2))


def test_the_offset_is_that_of_the_row_and_that_of_the_column() -> None:
    view = noise(8, 4)
    rows, columns = np.float32([0, 1, 0, -1, 0, 1, 1, 0]), np.float32([0, 1, 2, -1])
    made = shifted_rows(view, rows, columns)
    for y, x in np.ndindex(8, 4):
        assert made[y, x] == view[int(np.clip(y + rows[y] + columns[x], 0, 7)), x]


def test_a_block_with_context_gives_the_rows_of_the_whole() -> None:
    view, rows, columns = (
        noise(40, 6),
        np.linspace(-2, 2, 40, dtype=np.float32),
        np.linspace(-1, 1, 6, dtype=np.float32),
    )
    whole = shifted_rows(view, rows, columns)
    np.testing.assert_array_equal(shifted_rows(view[10:30], rows[10:30], columns)[5:15], whole[15:25])


def test_offsets_of_another_size_are_refused() -> None:
    with pytest.raises(StageError, match="the alignment is of 3 x 4 px, the view of"):
        shifted_rows(noise(4, 4), zeros(3), zeros(4))
