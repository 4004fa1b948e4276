import numpy as np
import pytest

from semidense.stages.compute.precision import Precision
from semidense.stages.learning.parameters import to_vector
from semidense.stages.matching import cost_volume as module
from semidense.stages.matching.cost_volume import cost_volume, padded_cost_volume, valid_columns
from semidense.stages.matching.declaration import COST_VOLUME, CostVolumeParams, Head
from semidense.stages.stage import StageError
from tests.stages.matching.reference import literal_volume, random_net, shifted_scene
from tests.stages.tiling import tiled, whole

DIMS = {"channels": {"channels": ("view", "channel", "y", "x")}, "matching_net": {"parameters": ("parameter",)}}

EXACT = 1e-4
"""Largest difference of two exact forms in float32: the order of their sums, and of their roundings, differs."""


def views(channels: int = 3, height: int = 6, width: int = 9, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(2, channels, height, width)).astype(np.float32)


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """Return the largest difference of two volumes that are NaN in the same cells."""
    assert one.shape == other.shape and np.array_equal(np.isnan(one), np.isnan(other))
    return float(np.nanmax(np.abs(one.astype(np.float64) - other)))


@pytest.mark.parametrize(
    ("disparity", "columns"),
    [
        pytest.param(0, (0, 9), id="every column"),
        pytest.param(2, (2, 9), id="the left border has no match"),
        pytest.param(-2, (0, 7), id="negative: nor has the right border"),
        pytest.param(8, (8, 9), id="the last column only"),
        pytest.param(-8, (0, 1), id="the first column only"),
        pytest.param(9, (9, 9), id="the image's width: none"),
        pytest.param(50, (9, 9), id="far beyond: none"),
        pytest.param(-50, (0, 0), id="far beyond, negative: none"),
    ],
)
def test_valid_columns(disparity: int, columns: tuple[int, int]) -> None:
    assert valid_columns(disparity, 9) == columns


@pytest.mark.parametrize(
    ("channels", "head", "disparities"),
    [
        pytest.param(1, "compact", range(0, 4), id="one channel"),
        pytest.param(2, "paper", range(-2, 3), id="two channels, negative disparities, the paper's head"),
        pytest.param(3, "compact", range(-12, 13), id="three channels, a range wider than the image"),
        pytest.param(3, "paper", range(3, 4), id="a single disparity"),
    ],
)
def test_equals_the_patches_everywhere(channels: int, head: Head, disparities: range) -> None:
    """Borders and interior: the image is smaller than a patch, so that every cell meets a border, or wider."""
    net = random_net(channels, head)
    for shape in ((6, 9), (13, 17)) if len(disparities) < 5 and head == "compact" else ((6, 9),):
        given = views(channels, *shape)
        expected = literal_volume(net, given, disparities)
        made = cost_volume(net, given, disparities)
        assert made.shape == (*shape, len(disparities)) and made.dtype == np.float32 and made.flags.c_contiguous
        assert difference(made, expected) <= EXACT
        assert np.nanstd(expected) > 0.1


def test_invalid_cells_and_only_those_are_nan() -> None:
    made = cost_volume(random_net(), views(), range(-11, 12))
    x, d = np.arange(9)[:, None], np.arange(-11, 12)
    outside = (x - d < 0) | (x - d >= 9)
    assert np.array_equal(np.isnan(made), np.broadcast_to(outside, made.shape))


@pytest.mark.parametrize("columns", [1, 4, 16, 17, 1000])
def test_the_blocking_of_columns_does_not_matter(columns: int, monkeypatch: pytest.MonkeyPatch) -> None:
    net, given = random_net(), views(width=17)
    expected = cost_volume(net, given, range(-2, 4))
    monkeypatch.setattr(module, "COLUMNS", columns)
    assert difference(cost_volume(net, given, range(-2, 4)), expected) <= EXACT


@pytest.mark.parametrize("rows", [1, 3, 4, 7])
def test_the_blocking_of_rows_does_not_matter(rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    net, given = random_net(), views(height=7)
    expected = cost_volume(net, given, range(-2, 4))
    monkeypatch.setattr(module, "ROWS", rows)
    assert difference(cost_volume(net, given, range(-2, 4)), expected) <= EXACT


def test_a_disparity_does_not_depend_on_the_range_around_it() -> None:
    net, given = random_net(), views(width=12)
    wide = cost_volume(net, given, range(-3, 6))
    assert difference(cost_volume(net, given, range(1, 4)), wide[:, :, 4:7]) <= 1e-6


def test_is_deterministic() -> None:
    one, other = (cost_volume(random_net(), views(), range(4)) for _ in range(2))
    assert np.array_equal(one, other, equal_nan=True)


def test_a_constant_image_costs_the_same_everywhere() -> None:
    made = cost_volume(random_net(), np.full((2, 3, 5, 7), 0.25, np.float32), range(-1, 2))
    assert np.nanmax(made) - np.nanmin(made) <= EXACT


@pytest.mark.parametrize("seed", range(4))
def test_bfloat16_is_close_to_float32(seed: int) -> None:
    """bfloat16 keeps 8 bits: within 1 % of the costs' spread on average, 4 % for 99 cells of 100, 8 % for the last."""
    net, given = random_net(), views(height=16, width=24, seed=seed)
    exact = cost_volume(net, given, range(-2, 6))
    rough = cost_volume(net, given, range(-2, 6), "bfloat16")
    off = np.abs(rough - exact)[~np.isnan(exact)] / (np.nanmax(exact) - np.nanmin(exact))
    assert rough.dtype == np.float32 and np.array_equal(np.isnan(rough), np.isnan(exact))
    assert 0 < off.mean() <= 0.01
    assert np.quantile(off, 0.99) <= 0.04
    assert off.max() <= 0.08


def test_views_may_bring_their_own_context() -> None:
    net, given = random_net(), views(height=18, width=9)
    rows = np.pad(given, ((0, 0), (0, 0), (5, 5), (5, 5)), mode="edge")[:, :, 4:18]
    assert difference(padded_cost_volume(net, rows, range(3)), cost_volume(net, given, range(3))[4:8]) <= EXACT


@pytest.mark.parametrize(
    ("rows", "precision"), [(1, "float32"), (7, "float32"), (20, "float32"), (4, "bfloat16"), (20, "bfloat16")]
)
def test_tiles_equal_the_whole(rows: int, precision: Precision) -> None:
    """As far as float16 tells: the order of the sums in a convolution may depend on the size of its input.

    In bfloat16 for tiles of a multiple of four rows, as the stage's own are: others begin their transforms elsewhere.
    """
    scene = shifted_scene(height=23, width=21)
    given = {"channels": scene["channels"], "matching_net": {"parameters": to_vector(random_net())}}
    params = CostVolumeParams(d_min=-2, d_max=5, precision=precision)
    one, other = tiled(COST_VOLUME, params, given, DIMS, rows), whole(COST_VOLUME, params, given, DIMS)
    assert np.array_equal(one["d"], other["d"])
    largest = float(np.nanmax(np.abs(other["cost"])))
    assert difference(one["cost"], other["cost"]) <= 2**-10 * largest, "a unit in the last place"


def test_the_stage_makes_what_it_declares() -> None:
    net = random_net(2)
    given = {"channels": {"channels": np.pad(views(2), ((0, 0), (0, 0), (5, 5), (5, 5)), mode="edge")}}
    given["matching_net"] = {"parameters": to_vector(net)}
    made = COST_VOLUME.function()(CostVolumeParams(d_min=-1, d_max=2, precision="float32"), given)
    assert made["d"].tolist() == [-1, 0, 1, 2]
    assert made["cost"].shape == (6, 9, 4)
    for output in COST_VOLUME.outputs:
        assert made[output.name].dtype == output.dtype and made[output.name].ndim == len(output.dims)
    assert difference(made["cost"], cost_volume(net, views(2), range(-1, 3))) <= 5e-3, "rounded to float16"


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        pytest.param((2, 2, 5, 6), r"expects 2 views of 3 channels, got \(2, 2\)", id="another channel count"),
        pytest.param((1, 3, 5, 6), r"expects 2 views of 3 channels, got \(1, 3\)", id="one view"),
        pytest.param((3, 5, 6), r"channels has shape \(3, 5, 6\), expected 4 dimensions", id="no axis of views"),
    ],
)
def test_refuses_other_shapes(shape: tuple[int, ...], message: str) -> None:
    with pytest.raises(StageError, match=message) as error:
        cost_volume(random_net(), np.zeros(shape, np.float32), range(3))
    assert "\n" not in str(error.value)
