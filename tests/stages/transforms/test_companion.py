import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from semidense.stages.stage import StageError
from semidense.stages.transforms.companion import companion

CROSS = [(0, 1), (0, -1), (1, 0), (-1, 0)]
DIAGONAL = [(1, 1), (1, -1), (-1, 1), (-1, -1)]
KNIGHT = [(a, b) for a in (-2, -1, 1, 2) for b in (-2, -1, 1, 2) if abs(a) != abs(b)]
STEPS = {4: CROSS, 8: CROSS + DIAGONAL, 16: CROSS + DIAGONAL + KNIGHT}


def direct(gray: np.ndarray, window: int, rays: int) -> np.ndarray:
    """The definition, ray by ray from each pixel."""
    out = np.zeros(gray.shape, np.float32)
    for y, x in np.ndindex(gray.shape):
        seen = [gray[q] for step in STEPS[rays] for q in _ray(gray.shape, (y, x), step, window // 2)]
        out[y, x] = np.float32(sum(value == gray[y, x] for value in seen) / len(seen)) if seen else 0
    return out


def _ray(shape: tuple[int, ...], p: tuple[int, int], step: tuple[int, int], radius: int) -> list[tuple[int, int]]:
    points = [(p[0] + k * step[0], p[1] + k * step[1]) for k in range(1, radius + 1)]
    return [
        (y, x)
        for y, x in points
        if 0 <= y < shape[0] and 0 <= x < shape[1] and max(abs(y - p[0]), abs(x - p[1])) <= radius
    ]


@pytest.mark.parametrize(
    ("rays", "pixels"),
    [
        pytest.param(4, 8, id="4: two on each ray"),
        pytest.param(8, 16, id="8: and two on each diagonal"),
        pytest.param(16, 24, id="16: and one on each knight's move, so the whole 5 x 5 window"),
    ],
)
def test_the_rays_by_hand(rays: int, pixels: int) -> None:
    """Light one pixel of the 7 x 7 image at a time like the centre: the answer says whether a ray holds it."""
    held = 0
    for y, x in np.ndindex(7, 7):
        gray = np.zeros((7, 7), np.uint8)
        gray[y, x] = gray[3, 3] = 9
        value = companion(gray, window=5, rays=rays)[3, 3]
        assert value in (0, np.float32(1 / pixels))
        held += value > 0
    assert held == pixels


def test_by_hand() -> None:
    gray = np.array([[1, 1, 2], [1, 1, 1], [3, 1, 3]], np.uint8)
    shares = [[3 / 3, 4 / 5, 0], [4 / 5, 5 / 8, 3 / 5], [0, 3 / 5, 0]]
    assert np.array_equal(companion(gray, window=3, rays=8), np.float32(shares))


@pytest.mark.parametrize("rays", [4, 8, 16])
@pytest.mark.parametrize(
    "shape",
    [
        pytest.param((9, 13), id="smaller than the window"),
        pytest.param((1, 70), id="one row"),
        pytest.param((70, 1), id="one column"),
        pytest.param((1, 1), id="one pixel"),
        pytest.param((2, 2), id="no room for a knight's move"),
        pytest.param((35, 66), id="larger than the window across"),
    ],
)
def test_equals_the_direct_loop(shape: tuple[int, int], rays: int) -> None:
    gray = np.random.default_rng(rays).integers(0, 3, shape).astype(np.uint8)
    assert np.array_equal(companion(gray, 61, rays), direct(gray, 61, rays))


@settings(max_examples=60)
@given(
    arrays(np.uint8, array_shapes(min_dims=2, max_dims=2, max_side=9), elements=st.integers(253, 255)),
    st.sampled_from([3, 5, 7, 61]),
    st.sampled_from([4, 8, 16]),
)
def test_equals_the_direct_loop_on_any_image(gray: np.ndarray, window: int, rays: int) -> None:
    made = companion(gray, window, rays)
    assert np.array_equal(made, direct(gray, window, rays))
    assert made.dtype == np.float32 and made.min() >= 0 and made.max() <= 1


@pytest.mark.parametrize("rays", [4, 8, 16])
def test_a_constant_image_is_one(rays: int) -> None:
    assert (companion(np.full((12, 15), 255, np.uint8), 61, rays) == 1).all()


def test_a_window_of_3_has_no_knights_move() -> None:
    gray = np.random.default_rng(0).integers(0, 2, (6, 6)).astype(np.uint8)
    assert np.array_equal(companion(gray, 3, 16), companion(gray, 3, 8))


def test_a_single_pixel_sees_nothing() -> None:
    assert companion(np.array([[7]], np.uint8)).tolist() == [[0]]


@given(arrays(np.uint8, (5, 6), elements=st.integers(0, 2)), st.sampled_from([4, 8, 16]))
def test_turning_and_mirroring_the_image_turns_the_answer(gray: np.ndarray, rays: int) -> None:
    assert np.array_equal(companion(gray.T, 5, rays), companion(gray, 5, rays).T)
    assert np.array_equal(companion(gray[:, ::-1], 5, rays), companion(gray, 5, rays)[:, ::-1])


@pytest.mark.parametrize(
    ("window", "rays", "message"),
    [
        pytest.param(60, 8, "window is 60 px, expected an odd number", id="even window"),
        pytest.param(1, 8, "window is 1 px", id="no neighbour"),
        pytest.param(61, 5, "rays is 5, expected one of 4, 8, 16", id="undefined number of rays"),
        pytest.param(61, 0, "rays is 0", id="no rays"),
    ],
)
def test_refuses(window: int, rays: int, message: str) -> None:
    with pytest.raises(StageError, match=message):
        companion(np.zeros((4, 4), np.uint8), window, rays)


def test_refuses_what_is_not_gray() -> None:
    with pytest.raises(StageError, match="apply to_gray first"):
        companion(np.zeros((4, 4, 3), np.uint8))
