import dask
import dask.array
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from semidense.pipeline.figures.cost_volume import draw_costs, draw_curve, expit, local_minima
from semidense.pipeline.figures.drawing import new_figure
from tests.pipeline.products import costvolume

N = np.nan


@pytest.mark.parametrize(
    ("costs", "expected"),
    [
        pytest.param([3, 1, 2, -1, 0], [3, 1], id="winner-then-runner-up"),
        pytest.param([0, 1, 2], [0], id="an-end-counts"),
        pytest.param([5, 2, 2, 2, 4], [1], id="a-plateau-counts-once"),
        pytest.param([5, 2, 2, 1, 4], [3], id="a-step-is-no-minimum"),
        pytest.param([4, N, 4, 5], [0, 2], id="beside-an-invalid-cost; of equal ones the first"),
        pytest.param([N, N], [], id="nothing-valid"),
        pytest.param([1], [0], id="one-disparity"),
    ],
)
def test_local_minima(costs: list[float], expected: list[int]) -> None:
    assert local_minima(np.array(costs, np.float32)) == expected


@settings(max_examples=40, deadline=None)
@given(st.lists(st.sampled_from([N, 0.0, 1.0, 2.0, 3.0]), min_size=1, max_size=12))
def test_the_first_minimum_is_what_the_winner_takes(costs: list[float]) -> None:
    array = np.array(costs, np.float32)
    expected = [int(np.nanargmin(array))] if np.isfinite(array).any() else []
    assert local_minima(array)[:1] == expected


def test_expit_survives_the_ends_of_float16() -> None:
    assert [expit(-65504.0), expit(65504.0)] == [0.0, 1.0]
    assert expit(2.0) == pytest.approx(1 / (1 + np.exp(-2)))


@pytest.mark.parametrize(
    ("log_odds", "text"),
    [(-65504.0, "0"), (-5.4, "0.0045"), (0.0, "0.5"), (0.2, "0.55"), (5.4, "0.9955"), (20.0, "1 - 2.1e-09")],
)
def test_a_probability_near_1_is_not_called_1(log_odds: float, text: str) -> None:
    axes = new_figure("any").subplots()
    draw_curve(axes, np.arange(2), np.array([log_odds, log_odds + 1]))
    assert f"probability {text}" in [line.get_label().rsplit(", ", 1)[-1] for line in axes.lines]


def test_the_pixel_is_valid_even_if_the_centre_is_not() -> None:
    volume = costvolume()
    volume["cost"][2, 3] = N
    figure = new_figure("any")
    draw_costs(figure, volume)
    assert "y = 2, x = 2" in figure.axes[1].get_title()


def test_a_volume_without_any_cost_is_drawn() -> None:
    volume = costvolume()
    volume["cost"][:] = N
    figure = new_figure("any")
    draw_costs(figure, volume)
    assert "costs at the disparity 0 px" in figure.axes[0].get_title()


def test_chosen_pixel_and_disparity_are_drawn() -> None:
    figure = new_figure("any")
    draw_costs(figure, costvolume(), pixel=(0, 1), disparity=4)
    left, right = figure.axes[:2]
    assert "4 px" in left.get_title()
    assert np.ma.count_masked(left.images[0].get_array()) == 16
    np.testing.assert_array_equal(right.lines[0].get_ydata(), [3, 1, N, N, N])


def test_the_volume_is_never_in_memory_as_a_whole() -> None:
    largest: list[int] = []

    def watched(block: np.ndarray) -> np.ndarray:
        largest.append(block.size)
        return block

    chunked = dask.array.zeros((320, 64, 8), dtype=np.float16, chunks=(32, 64, 8)).map_blocks(watched)
    volume = xr.Dataset({"cost": (("y", "x", "d"), chunked)}, coords={"d": np.arange(8)})
    sizes: list[int] = []

    def get(graph: object, keys: object, **options: object) -> object:
        found = dask.get(graph, keys, **options)
        sizes.extend(array.size for array in dask.core.flatten([found], (list, tuple)) if isinstance(array, np.ndarray))
        return found

    with dask.config.set(scheduler=get):
        draw_costs(new_figure("any"), volume)
    assert max(largest) == 32 * 64 * 8
    assert max(sizes) <= 2 * 32 * 64 * 8
    assert sum(sizes) < 320 * 64 * 8


@pytest.mark.parametrize(
    ("disparity", "told"),
    [
        pytest.param(1.25, ["truth: 1.25 px"], id="known"),
        pytest.param(N, [], id="unknown at this pixel"),
    ],
)
def test_the_truth_is_marked_on_the_curve(disparity: float, told: list[str]) -> None:
    true = np.full((4, 6), 3, np.float32)
    true[0, 1] = disparity
    figure = new_figure("any")
    draw_costs(figure, costvolume(), (0, 1), truth=xr.Dataset({"disparity": (("y", "x"), true)}))
    lines = [line for line in figure.axes[1].lines if str(line.get_label()).startswith("truth")]
    assert [line.get_label() for line in lines] == told
    assert [line.get_xdata()[0] for line in lines] == [disparity] * len(told)
