import numpy as np
import pytest
from pydantic import ValidationError

from semidense.stages.evaluation.silence.declaration import DISTINCTIVENESS, DistinctivenessParams
from semidense.stages.evaluation.silence.distinctiveness import distinctiveness
from semidense.stages.stage import StageError
from tests.stages.tiling import same, tiled, whole

SMALL = DistinctivenessParams(d_min=-2, d_max=6, window=3, margin=1, noise=0.5, share=0.25)


def noise(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width)).astype(np.uint8)


def literal(gray: np.ndarray, params: DistinctivenessParams) -> np.ndarray:
    """The formula, window by window and pixel by pixel."""
    size, (height, width) = params.window, gray.shape
    values = gray.astype(float)
    told = np.full(gray.shape, 100.0)
    for y in range(height - size + 1):
        for x in range(width - size + 1):
            window = values[y : y + size, x : x + size]
            others = [
                values[y : y + size, x + shift : x + shift + size]
                for step in range(4, params.reach + 1)
                for shift in (-step, step)
                if 0 <= x + shift <= width - size
            ]
            deviation = np.sqrt(np.mean((window - window.mean(axis=1, keepdims=True)) ** 2))
            least = min((np.abs(window - other).mean() for other in others), default=np.inf)
            near = (
                slice(max(0, y - params.margin), y + size + params.margin),
                slice(max(0, x - params.margin), x + size + params.margin),
            )
            told[near] = np.minimum(told[near], least / (params.noise + params.share * deviation))
    return told


@pytest.mark.parametrize(
    "gray",
    [
        pytest.param(noise(9, 17), id="noise"),
        pytest.param(noise(9, 17) // 64, id="a few levels"),
        pytest.param(np.repeat(noise(9, 1), 17, axis=1), id="stripes along the rows"),
        pytest.param(noise(3, 7), id="one row of windows, and only one shift fits"),
        pytest.param(noise(3, 6), id="no shift fits"),
        pytest.param(noise(2, 20), id="no window fits"),
        pytest.param(noise(1, 1), id="one pixel"),
    ],
)
def test_equals_the_formula(gray: np.ndarray) -> None:
    made = distinctiveness(gray, SMALL)
    assert made.dtype == np.float32 and made.shape == gray.shape
    assert np.allclose(made, literal(gray, SMALL), rtol=1e-6)


def blank(gray: np.ndarray) -> None:
    gray[:] = 200


def rows(gray: np.ndarray) -> None:
    gray[:] = np.where(np.arange(len(gray)) // 2 % 2, 30, 220)[:, np.newaxis]


def vertical_gradient(gray: np.ndarray) -> None:
    gray[:] = np.arange(len(gray))[:, np.newaxis] * 7


def columns(gray: np.ndarray) -> None:
    gray[:] = np.where(np.arange(gray.shape[1]) % 6 < 3, 90, 160)


def grained(gray: np.ndarray) -> None:
    gray[:] = np.where(np.random.default_rng(1).random(gray.shape) < 0.03, 201, 200)


@pytest.mark.parametrize("paint", [blank, rows, vertical_gradient, columns, grained])
def test_a_region_that_repeats_itself_is_told_up_to_its_border(paint: object) -> None:
    gray = noise(60, 80)
    paint(gray[20:45, 10:70])
    silent = distinctiveness(gray, DistinctivenessParams(d_min=0, d_max=30)) < 1
    assert silent[20:45, 10:70].all()
    silent[14:51, 4:76] = False
    assert not silent.any(), "noise beyond the margin is distinctive"


def test_a_period_beyond_the_disparities_is_distinctive() -> None:
    gray = np.tile(noise(30, 20), (1, 4))
    assert (distinctiveness(gray, DistinctivenessParams(d_min=0, d_max=20)) < 1).all()
    assert (distinctiveness(gray, DistinctivenessParams(d_min=0, d_max=19)) > 1).all()


def test_texture_across_the_rows_alone_is_none_and_along_them_is_enough() -> None:
    one = np.tile(noise(1, 60), (30, 1))
    params = DistinctivenessParams(d_min=0, d_max=20)
    assert (distinctiveness(one, params) > 1).all()
    assert (distinctiveness(np.ascontiguousarray(one.T), params) < 1).all()


@pytest.mark.parametrize("rows", [pytest.param(1, id="one row"), pytest.param(7, id="parts")])
def test_tiles_equal_the_whole(rows: int) -> None:
    left = noise(23, 31)[..., np.newaxis]
    left[4:16, 5:25] = 9
    given = {"images": {"left": left, "right": noise(23, 31, 1)[..., np.newaxis]}}
    dims = {"images": {"left": ("y", "x", "band"), "right": ("y", "x", "band")}}
    made = whole(DISTINCTIVENESS, SMALL, given, dims)
    assert same(tiled(DISTINCTIVENESS, SMALL, given, dims, rows), made)
    assert np.array_equal(made["left"], distinctiveness(left[..., 0], SMALL))
    assert made["left"].min() == 0 < made["right"].min()


def test_refuses_colours() -> None:
    with pytest.raises(StageError, match="apply to_gray first"):
        distinctiveness(np.zeros((9, 9, 3), np.uint8), SMALL)


def test_refuses_an_open_range() -> None:
    with pytest.raises(StageError, match="give d_min and d_max"):
        distinctiveness(noise(20, 20), DistinctivenessParams(d_min=0))


def test_a_patch_has_a_middle() -> None:
    with pytest.raises(ValidationError, match="window"):
        DistinctivenessParams(window=8)
