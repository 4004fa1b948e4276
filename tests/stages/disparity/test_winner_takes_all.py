import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from semidense.stages.disparity.declaration import DISPARITY, DisparityParams
from semidense.stages.disparity.winner_takes_all import refine_subpixel, winner_take_all
from semidense.stages.stage import StageError
from tests.stages.tiling import same, tiled, whole

N, I = np.nan, np.inf  # noqa: E741
DIMS = {"costvolume": {"cost": ("y", "x", "d"), "d": ("d",)}}
both = pytest.mark.parametrize("dtype", [np.float16, np.float32])


def cell(*costs: float, dtype: type = np.float32) -> np.ndarray:
    return np.array([[costs]], dtype)


def volume(seed: int = 0, shape: tuple[int, int, int] = (70, 9, 12)) -> dict[str, dict[str, np.ndarray]]:
    rng = np.random.default_rng(seed)
    cost = np.rint(rng.normal(size=shape) * 4).astype(np.float16)
    cost[rng.random(shape) < 0.2] = N
    cost[3] = N
    return {"costvolume": {"cost": cost, "d": np.arange(-2, shape[2] - 2, dtype=np.int16)}}


@both
@pytest.mark.parametrize(
    ("costs", "d_min", "expected"),
    [
        pytest.param((3, 1, 2), 0, 1, id="the least cost"),
        pytest.param((3, 1, 2), -5, -4, id="a negative range"),
        pytest.param((2, 1, 1), 10, 11, id="of equal costs the smallest d"),
        pytest.param((N, 5, N, 4), 0, 3, id="invalid cells are passed over"),
        pytest.param((N, 5, N), 0, 1, id="the only valid cell"),
        pytest.param((N, N, N), 0, N, id="no valid cell"),
        pytest.param((-1, -3, -2), 0, 1, id="negative costs"),
        pytest.param((0.0, -0.0), 0, 0, id="+0 and -0 are equal"),
        pytest.param((-0.0, 0.0), 0, 0, id="-0 and +0 are equal"),
        pytest.param((N, I, I), 0, 1, id="infinity is valid"),
        pytest.param((I, 7), 0, 1, id="but never better"),
        pytest.param((5, -I, -I), 0, 1, id="minus infinity is least"),
        pytest.param((6e-8, 0), 0, 1, id="subnormals count"),
        pytest.param((4,), 7, 7, id="one disparity"),
    ],
)
def test_by_hand(costs: tuple[float, ...], d_min: int, expected: float, dtype: type) -> None:
    made = winner_take_all(cell(*costs, dtype=dtype), d_min)
    assert made.dtype == np.float32 and made.shape == (1, 1)
    assert np.array_equal(made, [[expected]], equal_nan=True)


def test_every_half_is_ordered_as_its_value() -> None:
    """Each of the 65536 bit patterns against zero, one and a negative number, on both sides."""
    every = np.arange(65536, dtype=np.uint32).astype(np.uint16).view(np.float16)
    for other in np.float16([0, 1, -2]):
        for costs in (
            np.stack([every, np.full_like(every, other)], 1),
            np.stack([np.full_like(every, other), every], 1),
        ):
            wide = costs.astype(np.float32)
            expected = np.where(np.isnan(wide[:, 0]) | (wide[:, 1] < wide[:, 0]), 1, 0)
            assert np.array_equal(winner_take_all(costs[None], 0)[0], expected)


any_volume = arrays(
    np.float16, array_shapes(min_dims=3, max_dims=3, max_side=6), elements=st.floats(allow_nan=True, width=16)
)


@settings(max_examples=80)
@given(any_volume, st.integers(-9, 9))
def test_is_the_argmin_in_both_precisions(costs: np.ndarray, d_min: int) -> None:
    expected = np.full(costs.shape[:2], N, np.float32)
    for place in np.ndindex(costs.shape[:2]):
        valid = [(float(cost), d) for d, cost in enumerate(costs[place]) if not np.isnan(cost)]
        expected[place] = min(valid)[1] + d_min if valid else N
    assert np.array_equal(winner_take_all(costs, d_min), expected, equal_nan=True)
    assert np.array_equal(winner_take_all(costs.astype(np.float32), d_min), expected, equal_nan=True)


def test_reads_any_memory_layout() -> None:
    costs = volume()["costvolume"]["cost"]
    assert np.array_equal(winner_take_all(np.asfortranarray(costs), 0), winner_take_all(costs, 0), equal_nan=True)


@both
@pytest.mark.parametrize(
    ("costs", "expected"),
    [
        pytest.param((4, 1, 4), 1.0, id="symmetric: stays"),
        pytest.param((9, 1, 1), 1.5, id="half a pixel at most"),
        pytest.param((4, 0, 2), 1 + 1 / 6, id="by hand: (4 - 2) / (2 * 6)"),
        pytest.param((0, 5, 9), 0.0, id="lower end of the range"),
        pytest.param((9, 5, 0), 2.0, id="upper end of the range"),
        pytest.param((N, 1, 5), 1.0, id="invalid before"),
        pytest.param((5, 1, N), 1.0, id="invalid after"),
        pytest.param((I, 1, 5), 1.0, id="infinite before"),
        pytest.param((5, -I, 5), 1.0, id="infinite itself"),
        pytest.param((2, 2, 2), 0.0, id="flat, at the end"),
        pytest.param((N, N, N), N, id="nothing valid"),
    ],
)
def test_refinement_by_hand(costs: tuple[float, ...], expected: float, dtype: type) -> None:
    volume = cell(*costs, dtype=dtype)
    made = refine_subpixel(volume, winner_take_all(volume, -3), -3)
    assert made.dtype == np.float32
    assert made == pytest.approx(np.array([[expected - 3]]), abs=1e-6, nan_ok=True)


def test_refinement_finds_the_lowest_point_of_a_parabola() -> None:
    lowest = np.linspace(2.6, 7.4, 25)
    costs = ((np.arange(11) - lowest[:, None]) ** 2)[None].astype(np.float32)
    assert refine_subpixel(costs, winner_take_all(costs, 0), 0)[0] == pytest.approx(lowest, abs=1e-5)


def test_refinement_of_a_flat_cost_and_of_a_hill() -> None:
    assert refine_subpixel(cell(2, 2, 2), np.float32([[1]]), 0).tolist() == [[1]]
    assert refine_subpixel(cell(1, 2, 1), np.float32([[1]]), 0).tolist() == [[1]]


@settings(max_examples=50)
@given(any_volume)
@pytest.mark.filterwarnings("error")
def test_refinement_moves_by_half_a_pixel_at_most(costs: np.ndarray) -> None:
    raw = winner_take_all(costs, 4)
    made = refine_subpixel(costs, raw, 4)
    assert np.array_equal(np.isnan(made), np.isnan(raw))
    assert (np.abs(made - raw)[~np.isnan(raw)] <= 0.5).all()


def test_refinement_leaves_its_input_alone() -> None:
    costs, raw = cell(4, 0, 2), np.float32([[1]])
    refine_subpixel(costs, raw, 0)
    assert raw.tolist() == [[1]]


@pytest.mark.parametrize(
    ("disparity", "message"),
    [
        pytest.param([[3.0]], "disparity 3 px is none of the volume's 0 to 2 px", id="above the range"),
        pytest.param([[-1.0]], "disparity -1 px is none", id="below the range"),
        pytest.param([[0.5]], "disparity 0.5 px is none", id="between two"),
        pytest.param([[I]], "disparity inf px is none", id="infinite"),
        pytest.param([[1.0, 1.0]], r"disparity has shape \(1, 2\), the cost volume \(1, 1, 3\)", id="another shape"),
    ],
)
def test_refinement_refuses(disparity: list[list[float]], message: str) -> None:
    with pytest.raises(StageError, match=message):
        refine_subpixel(cell(1, 2, 3), np.float32(disparity), 0)


@pytest.mark.parametrize(
    ("costs", "message"),
    [
        pytest.param(np.zeros((2, 2), np.float16), r"the cost volume has shape \(2, 2\), expected 3", id="no d"),
        pytest.param(np.zeros((2, 2, 3), np.float64), "dtype float64, expected float16 or float32", id="double"),
        pytest.param(np.zeros((2, 2, 0), np.float16), "no disparity to choose from", id="empty range"),
    ],
)
def test_refuses(costs: np.ndarray, message: str) -> None:
    with pytest.raises(StageError, match=message) as error:
        winner_take_all(costs, 0)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("subpixel", [False, True])
@pytest.mark.parametrize("rows", [1, 32, 69])
def test_tiles_equal_the_whole(rows: int, subpixel: bool) -> None:
    params = DisparityParams(subpixel=subpixel)
    assert same(tiled(DISPARITY, params, volume(), DIMS, rows), whole(DISPARITY, params, volume(), DIMS))


def test_the_stage_reads_the_range_from_the_coordinate() -> None:
    given = volume()
    made = DISPARITY.function()(DisparityParams(), given)["disparity"]
    assert np.array_equal(made, winner_take_all(given["costvolume"]["cost"], -2), equal_nan=True)
    assert made.dtype == DISPARITY.outputs[0].dtype and np.isnan(made[3]).all()


def test_the_stage_refines_when_asked() -> None:
    made = DISPARITY.function()(DisparityParams(subpixel=True), volume())["disparity"]
    assert (made != np.rint(made)).any()


def test_the_stage_refuses_a_coordinate_of_another_length() -> None:
    given = volume()["costvolume"]
    with pytest.raises(StageError, match=r"its coordinate d \(11,\)"):
        DISPARITY.function()(DisparityParams(), {"costvolume": {"cost": given["cost"], "d": given["d"][1:]}})
