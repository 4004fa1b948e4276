import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from semidense.stages.stage import StageError
from semidense.stages.transforms.rank import rank


def direct(gray: np.ndarray, window: int) -> np.ndarray:
    """The definition, pixel by pixel; the quotient of two small integers rounds correctly to float32."""
    radius, out = window // 2, np.empty(gray.shape, np.float32)
    for y, x in np.ndindex(gray.shape):
        near = gray[max(0, y - radius) : y + radius + 1, max(0, x - radius) : x + radius + 1]
        out[y, x] = np.float32(np.count_nonzero(near > gray[y, x]) / near.size)
    return out


def test_by_hand() -> None:
    gray = np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]], np.uint8)
    shares = [[3 / 4, 4 / 6, 2 / 4], [3 / 6, 4 / 9, 2 / 6], [1 / 4, 1 / 6, 0]]
    assert np.array_equal(rank(gray, window=3), np.float32(shares))


def test_equal_pixels_are_not_brighter() -> None:
    assert rank(np.array([[5, 5, 6]], np.uint8), window=5).tolist() == [[np.float32(1 / 3)] * 2 + [0]]


@pytest.mark.parametrize(
    "shape",
    [
        pytest.param((9, 13), id="smaller than the window"),
        pytest.param((1, 40), id="one row"),
        pytest.param((40, 1), id="one column"),
        pytest.param((1, 1), id="one pixel"),
        pytest.param((45, 50), id="larger than the window"),
    ],
)
@pytest.mark.parametrize("levels", [1, 3, 256])
def test_equals_the_direct_loop(shape: tuple[int, int], levels: int) -> None:
    gray = np.random.default_rng(levels).integers(256 - levels, 256, shape).astype(np.uint8)
    assert np.array_equal(rank(gray, 31), direct(gray, 31))


@settings(max_examples=60)
@given(arrays(np.uint8, array_shapes(min_dims=2, max_dims=2, max_side=12)), st.sampled_from([3, 5, 7, 31]))
def test_equals_the_direct_loop_on_any_image(gray: np.ndarray, window: int) -> None:
    made = rank(gray, window)
    assert np.array_equal(made, direct(gray, window))
    assert made.dtype == np.float32 and made.min() >= 0 and made.max() < 1


@given(arrays(np.uint8, (6, 7), elements=st.integers(0, 100)))
def test_lighting_that_keeps_the_order_changes_nothing(gray: np.ndarray) -> None:
    assert np.array_equal(rank(gray, 5), rank((2 * gray + 55).astype(np.uint8), 5))


@pytest.mark.parametrize("window", [255, 257, 599])
def test_a_large_window_counts_beyond_16_bits(window: int) -> None:
    gray = np.full((300, 300), 255, np.uint8)
    gray[150, 150] = 0
    size = min(window, 300) ** 2
    assert rank(gray, window)[150, 150] == np.float32((size - 1) / size)


def test_a_constant_image_is_zero() -> None:
    assert not rank(np.full((20, 30), 255, np.uint8)).any()


def test_is_deterministic_and_reads_any_memory_layout() -> None:
    gray = np.random.default_rng(3).integers(0, 256, (30, 20)).astype(np.uint8)
    assert np.array_equal(rank(gray), rank(np.asfortranarray(gray)))
    assert np.array_equal(rank(gray[::2, ::2]), rank(gray[::2, ::2].copy()))


def test_does_not_write_to_its_input() -> None:
    gray = np.arange(12, dtype=np.uint8).reshape(3, 4)
    gray.flags.writeable = False
    assert rank(gray, 3).shape == (3, 4)


@pytest.mark.parametrize(
    ("window", "message"),
    [
        pytest.param(30, "window is 30 px, expected an odd number of at least 3", id="even: no centre"),
        pytest.param(1, "window is 1 px", id="no neighbour"),
        pytest.param(-3, "window is -3 px", id="negative"),
    ],
)
def test_refuses_a_window(window: int, message: str) -> None:
    with pytest.raises(StageError, match=message):
        rank(np.zeros((4, 4), np.uint8), window)


@pytest.mark.parametrize(
    "gray",
    [
        pytest.param(np.zeros((4, 4), np.uint16), id="16 bits"),
        pytest.param(np.zeros((4, 4, 3), np.uint8), id="colour"),
        pytest.param(np.zeros((0, 4), np.uint8), id="empty"),
    ],
)
def test_refuses_an_image(gray: np.ndarray) -> None:
    with pytest.raises(StageError, match="expected \\(y, x\\) uint8 with pixels") as error:
        rank(gray)
    assert "\n" not in str(error.value)
