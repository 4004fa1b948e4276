import numpy as np
import pytest

from semidense.stages.stage import StageError
from semidense.stages.transforms.census import census_transform, hamming


def test_a_bit_is_set_for_each_darker_neighbour() -> None:
    gray = np.full((7, 9), 5, np.uint8)
    gray[0, 0], gray[6, 8] = 4, 3
    signature = int(census_transform(gray, (7, 9))[3, 4])
    assert signature == (1 << 61) | 1, "the first neighbour is the highest of 62 bits, the last the lowest"


def test_neighbours_beyond_the_image_are_not_darker() -> None:
    assert not census_transform(np.full((5, 6), 200, np.uint8), (7, 9)).any()


@pytest.mark.parametrize(
    ("one", "other", "bits"),
    [
        pytest.param(0, 0, 0, id="equal"),
        pytest.param(0, 2**64 - 1, 64, id="all differ"),
        pytest.param(2**63, 1, 2, id="the ends"),
    ],
)
def test_the_distance_counts_different_bits(one: int, other: int, bits: int) -> None:
    assert hamming(np.array([[one]], np.uint64), np.array([[other]], np.uint64)).item() == bits


def test_random_distances_are_those_of_python() -> None:
    left, right = np.random.default_rng(0).integers(0, 2**64, (2, 5, 7), dtype=np.uint64)
    expected = [
        [(int(a) ^ int(b)).bit_count() for a, b in zip(*rows, strict=True)] for rows in zip(left, right, strict=True)
    ]
    np.testing.assert_array_equal(hamming(left, right), expected)


@pytest.mark.parametrize("window", [(4, 5), (5, 4), (11, 11)])
def test_a_window_that_is_even_or_too_large_is_refused(window: tuple[int, int]) -> None:
    with pytest.raises(StageError, match=f"window {window[0]} x {window[1]}"):
        census_transform(np.zeros((9, 9)), window)


def test_signatures_of_two_shapes_are_refused() -> None:
    with pytest.raises(StageError, match=r"\(3, 4\) and \(1, 1\)"):
        hamming(np.zeros((3, 4), np.uint64), np.zeros((1, 1), np.uint64))
