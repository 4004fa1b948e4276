from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from semidense.stages.compute.precision import Precision
from semidense.stages.disparity.winner_takes_all import refine_subpixel, winner_take_all
from semidense.stages.learning.parameters import to_vector
from semidense.stages.matching.cost_volume import cost_volume
from semidense.stages.matching.declaration import COST_VOLUME, MARGIN, REACH, CostVolumeParams, Head
from semidense.stages.matching.guided import volume as module
from semidense.stages.matching.guided.volume import padded_guided_costs
from semidense.stages.matching.winograd.tiles import TILE
from semidense.stages.stage import StageError
from tests.stages.matching.descriptors.test_volume import random_descriptor_net
from tests.stages.matching.reference import random_net, shifted_scene
from tests.stages.tiling import same, tiled, whole

DIMS = {
    "channels": {"channels": ("view", "channel", "y", "x")},
    "matching_net": {"parameters": ("parameter",)},
    "descriptor_net": {"parameters": ("parameter",)},
}
VOTES = 12
EXACT = 1e-4
"""Largest difference of two exact forms in float32: the order of their sums, and of their roundings, differs."""
ROUGH = 0.1
"""Likewise in bfloat16, where a sum of another order may be rounded to the next number: a hundredth of the spread."""


def views(channels: int = 3, height: int = 10, width: int = 23, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(2, channels, height, width)).astype(np.float32)


def vectors() -> dict[str, dict[str, np.ndarray]]:
    return {
        "matching_net": {"parameters": to_vector(random_net())},
        "descriptor_net": {"parameters": to_vector(random_descriptor_net())},
    }


def guided_cost_volume(net: Any, descriptor_net: Any, channels: NDArray[np.float32], *how: Any, **named: Any) -> Any:  # noqa: ANN401
    """The guided volume of a whole pair, whose context is its edge."""
    margin = [*[(0, 0)] * (channels.ndim - 2), (MARGIN, MARGIN), (MARGIN, MARGIN)]
    return padded_guided_costs(net, descriptor_net, np.pad(channels, margin, mode="edge"), *how, **named)


@pytest.mark.parametrize(
    ("channels", "head", "precision", "disparities", "bound"),
    [
        pytest.param(3, "compact", "float32", range(0, 9), EXACT, id="transformed"),
        pytest.param(2, "compact", "float32", range(-12, 13), EXACT, id="negative disparities: both borders"),
        pytest.param(1, "compact", "float32", range(-40, 41), EXACT, id="a range wider than the image"),
        pytest.param(2, "paper", "float32", range(-2, 3), EXACT, id="the paper's head, directly"),
        pytest.param(3, "compact", "bfloat16", range(0, 6), ROUGH, id="bfloat16"),
        pytest.param(3, "compact", "bfloat16", range(-12, 13), ROUGH, id="bfloat16, negative disparities"),
    ],
)
def test_what_is_judged_is_the_exact_volume(
    channels: int, head: Head, precision: Precision, disparities: range, bound: float
) -> None:
    """On noise, where every tile proposes other disparities; its size is no multiple of a tile."""
    net, given = random_net(channels, head), views(channels)
    exact = cost_volume(net, given, disparities, precision)
    made = guided_cost_volume(net, random_descriptor_net(given.shape[1]), given, disparities, VOTES, precision)
    judged = ~np.isnan(made)
    assert made.shape == exact.shape and made.dtype == np.float32 and made.flags.c_contiguous
    assert not (judged & np.isnan(exact)).any(), "an invalid cell stays invalid"
    assert np.array_equal(judged.any(2), ~np.isnan(exact).all(2)), "each pixel that has a cell is judged somewhere"
    assert 0.05 < judged.sum() / (~np.isnan(exact)).sum() < 1
    assert np.abs(made - exact)[judged].max() <= bound


def test_skipped_cells_never_win_and_stop_the_parabola() -> None:
    net, given = random_net(), views(width=40)
    made = guided_cost_volume(net, random_descriptor_net(given.shape[1]), given, range(12), VOTES).astype(np.float16)
    disparity = winner_take_all(made, 0)
    rows, columns = np.indices(disparity.shape)
    assert np.isfinite(made[rows, columns, disparity.astype(int)]).all()
    lonely = np.isnan(np.pad(made, ((0, 0), (0, 0), (1, 1)), constant_values=np.nan))
    beside = lonely[rows, columns, disparity.astype(int)] | lonely[rows, columns, disparity.astype(int) + 2]
    refined = refine_subpixel(made, disparity, 0)
    assert beside.any() and np.array_equal(refined[beside], disparity[beside])


def test_where_all_is_proposed_it_is_the_exact_volume() -> None:
    net, given = random_net(1), views(1, width=40)
    made = guided_cost_volume(net, random_descriptor_net(given.shape[1]), given, range(2), votes=1)
    exact = cost_volume(net, given, range(2))
    assert np.array_equal(np.isnan(made), np.isnan(exact)) and np.nanmax(np.abs(made - exact)) <= EXACT


@pytest.mark.parametrize("batch", [1, 7, 1000])
def test_the_batches_do_not_matter(batch: int, monkeypatch: pytest.MonkeyPatch) -> None:
    net, given = random_net(), views(width=30)
    expected = guided_cost_volume(net, random_descriptor_net(given.shape[1]), given, range(6), VOTES)
    monkeypatch.setattr(module, "BATCH", batch)
    monkeypatch.setattr(module, "COLUMNS", 3)
    made = guided_cost_volume(net, random_descriptor_net(given.shape[1]), given, range(6), VOTES)
    assert np.array_equal(np.isnan(made), np.isnan(expected)) and np.nanmax(np.abs(made - expected)) <= EXACT


@pytest.mark.parametrize("rows", [4, 8, 20])
def test_tiles_equal_the_whole(rows: int) -> None:
    """Rows of a tile are a multiple of four, as the stage's own 32 are; to the last place of float16."""
    scene = shifted_scene(height=23, width=40)
    given = {"channels": scene["channels"], **vectors()}
    params = CostVolumeParams(d_min=-2, d_max=9, precision="float32", mode="guided", votes=VOTES)
    one, other = tiled(COST_VOLUME, params, given, DIMS, rows), whole(COST_VOLUME, params, given, DIMS)
    skipped = np.isnan(other["cost"])
    assert np.array_equal(np.isnan(one["cost"]), skipped) and 0.3 < skipped.mean() < 1
    largest = float(np.nanmax(np.abs(other["cost"])))
    assert np.nanmax(np.abs(one["cost"].astype(np.float64) - other["cost"])) <= 2**-10 * largest


def test_the_stage_is_exact_unless_told_otherwise() -> None:
    scene = shifted_scene(height=12, width=30)
    given = {"channels": scene["channels"], **vectors()}
    usual, exact, guided = (
        whole(COST_VOLUME, CostVolumeParams(d_min=0, d_max=9, precision="float32", **mode), given, DIMS)
        for mode in ({}, {"mode": "exact", "votes": 100}, {"mode": "guided"})
    )
    assert same(usual, exact) and not same(usual, guided)


def test_is_deterministic() -> None:
    one, other = (guided_cost_volume(random_net(), random_descriptor_net(), views(), range(4), VOTES) for _ in range(2))
    assert np.array_equal(one, other, equal_nan=True)


def test_a_constant_image_is_judged_too() -> None:
    given = np.full((2, 3, 6, 14), 0.25, np.float32)
    made = guided_cost_volume(random_net(), random_descriptor_net(), given, range(-1, 2), VOTES)
    assert np.isfinite(made).any(2).all() and np.isnan(made).any()


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        pytest.param((2, 2, 5, 6), r"expects 2 views of 3 channels, got \(2, 2\)", id="another channel count"),
        pytest.param((3, 5, 6), r"channels has shape \(3, 29, 30\), expected 4 dimensions", id="no axis of views"),
    ],
)
def test_refuses_other_shapes(shape: tuple[int, ...], message: str) -> None:
    with pytest.raises(StageError, match=message):
        guided_cost_volume(random_net(), random_descriptor_net(), np.zeros(shape, np.float32), range(3), VOTES)


def test_the_context_is_what_the_stage_asks_for() -> None:
    assert COST_VOLUME.halo(CostVolumeParams(mode="guided")) == REACH + TILE
