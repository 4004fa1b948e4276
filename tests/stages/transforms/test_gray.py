from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from semidense.stages.stage import StageError
from semidense.stages.transforms.gray import gray_moments, to_gray


@pytest.mark.parametrize(
    ("rgb", "gray"),
    [
        pytest.param((0, 0, 0), 0, id="black"),
        pytest.param((255, 255, 255), 255, id="white: the weights sum to one"),
        pytest.param((255, 0, 0), 76, id="76.245 rounds down"),
        pytest.param((0, 255, 0), 150, id="149.685 rounds up"),
        pytest.param((0, 0, 255), 29, id="29.07 rounds down"),
        pytest.param((0, 2, 254), 30, id="1.174 + 28.956 = 30.13"),
        pytest.param((5, 0, 0), 1, id="1.495 rounds down"),
        pytest.param((2, 1, 135), 17, id="16.575 rounds up"),
        pytest.param((0, 250, 0), 147, id="146.75"),
        pytest.param((1, 1, 1), 1, id="a gray colour keeps its value"),
        pytest.param((0, 100, 50), 64, id="58.7 + 5.7 = 64.4"),
        pytest.param((100, 2, 99), 42, id="29.9 + 1.174 + 11.286 = 42.36"),
        pytest.param((5, 15, 0), 10, id="1.495 + 8.805 = 10.3"),
        pytest.param((0, 0, 250), 29, id="28.5 exactly: half goes up"),
    ],
)
def test_luma_by_hand(rgb: tuple[int, int, int], gray: int) -> None:
    assert to_gray(np.array([[rgb]], np.uint8)).tolist() == [[gray]]


@pytest.mark.parametrize(
    ("value", "gray"),
    [
        pytest.param(0, 0, id="zero"),
        pytest.param(128, 0, id="128/257 = 0.498"),
        pytest.param(129, 1, id="129/257 = 0.502"),
        pytest.param(257, 1, id="an 8-bit 1"),
        pytest.param(511, 2, id="not truncated: 511 >> 8 would be 1"),
        pytest.param(65535, 255, id="full range"),
        pytest.param(256, 1, id="not wrapped: 256 as uint8 would be 0"),
    ],
)
def test_sixteen_bits_of_one_band(value: int, gray: int) -> None:
    assert to_gray(np.array([[value]], np.uint16)).tolist() == [[gray]]


colours = arrays(np.uint8, st.tuples(st.integers(1, 4), st.integers(1, 4), st.just(3)))


@given(colours)
def test_luma_is_the_nearest_integer(image: np.ndarray) -> None:
    for pixel, gray in zip(image.reshape(-1, 3).tolist(), to_gray(image).ravel().tolist(), strict=True):
        luma = Fraction(sum(weight * band for weight, band in zip((299, 587, 114), pixel, strict=True)), 1000)
        assert Fraction(-1, 2) < gray - luma <= Fraction(1, 2)


@given(colours)
def test_an_8_bit_image_in_16_bits_gives_the_same_gray(image: np.ndarray) -> None:
    assert np.array_equal(to_gray(image.astype(np.uint16) * np.uint16(257)), to_gray(image))


@given(arrays(np.uint16, (2, 3, 3)))
def test_sixteen_bit_luma_is_rounded_once(image: np.ndarray) -> None:
    for pixel, gray in zip(image.reshape(-1, 3).tolist(), to_gray(image).ravel().tolist(), strict=True):
        luma = Fraction(sum(weight * band for weight, band in zip((299, 587, 114), pixel, strict=True)), 257000)
        assert abs(gray - luma) <= Fraction(1, 2)


def test_one_band_is_passed_through_in_either_shape() -> None:
    image = np.arange(256, dtype=np.uint8).reshape(16, 16)
    assert np.array_equal(to_gray(image), image)
    assert np.array_equal(to_gray(image[..., None]), image)
    assert to_gray(image).dtype == np.uint8


@pytest.mark.parametrize(
    ("image", "message"),
    [
        pytest.param(np.zeros((2, 2)), "image has dtype float64, expected uint8 or uint16", id="float: range unknown"),
        pytest.param(np.zeros((2, 2), np.int16), "dtype int16", id="signed"),
        pytest.param(np.zeros((2, 2, 4), np.uint8), r"image has shape \(2, 2, 4\)", id="alpha"),
        pytest.param(np.zeros((2, 2, 2), np.uint8), r"shape \(2, 2, 2\)", id="two bands"),
        pytest.param(np.zeros(4, np.uint8), r"shape \(4,\)", id="a row"),
        pytest.param(np.zeros((0, 4), np.uint8), "there is no pixel", id="empty"),
    ],
)
def test_refuses(image: np.ndarray, message: str) -> None:
    with pytest.raises(StageError, match=message) as error:
        to_gray(image)
    assert "\n" not in str(error.value)


@given(arrays(np.uint8, array_shapes(min_dims=2, max_dims=2, max_side=8)))
def test_moments_are_the_mean_and_the_deviation(gray: np.ndarray) -> None:
    assert gray_moments(gray) == pytest.approx((gray.mean(), gray.std()), abs=1e-9)


def test_moments_do_not_depend_on_the_order_of_pixels() -> None:
    gray = np.random.default_rng(1).integers(0, 256, (37, 41)).astype(np.uint8)
    assert gray_moments(gray) == gray_moments(np.asfortranarray(gray[::-1, ::-1])) == gray_moments(gray.T)


def test_moments_of_a_constant_image() -> None:
    assert gray_moments(np.full((3, 5), 200, np.uint8)) == (200.0, 0.0)


@pytest.mark.parametrize("gray", [np.zeros((2, 2)), np.zeros((0, 2), np.uint8), np.zeros((2, 2, 1), np.uint8)])
def test_moments_refuse_what_is_not_gray(gray: np.ndarray) -> None:
    with pytest.raises(StageError, match="apply to_gray first"):
        gray_moments(gray)
