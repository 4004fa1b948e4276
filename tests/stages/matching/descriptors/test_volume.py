from typing import get_args

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.nn import functional

from semidense.stages.compute.precision import Precision
from semidense.stages.learning.parameters import initialise, to_vector
from semidense.stages.matching.declaration import CHUNK, COST_VOLUME, DILATIONS, REACH, CostVolumeParams
from semidense.stages.matching.descriptors import volume as module
from semidense.stages.matching.descriptors.declaration import WIDTH, Width
from semidense.stages.matching.descriptors.net import DescriptorNet, descriptor_net_from_parameters
from semidense.stages.matching.descriptors.volume import diagonals, fast_cost_volume
from semidense.stages.stage import StageError
from tests.stages.matching.reference import shifted_scene
from tests.stages.tiling import tiled, whole

DIMS = {"channels": {"channels": ("view", "channel", "y", "x")}, "descriptor_net": {"parameters": ("parameter",)}}


def random_descriptor_net(channels: int = 3, width: Width = WIDTH) -> DescriptorNet:
    """Return a network with nothing at zero."""
    net = DescriptorNet(channels, width)
    initialise(net, 0)
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for name, parameter in net.named_parameters():
            if name.endswith("bias"):
                parameter.normal_(0, 0.2, generator=generator)
        net.input_mean.normal_(0, 0.3, generator=generator)
        net.input_std.uniform_(0.5, 2, generator=generator)
    return net.requires_grad_(False)


def views(channels: int = 3, height: int = 6, width: int = 23) -> np.ndarray:
    return np.random.default_rng(0).normal(size=(2, channels, height, width)).astype(np.float32)


def literal_descriptor(net: DescriptorNet, patch: Tensor) -> Tensor:
    """Return the descriptor of the middle of a 17 x 17 patch, by kernels with their gaps written out as zeros."""
    maps = ((patch - net.input_mean[:, None, None]) / net.input_std[:, None, None])[None]
    for index, (layer, step) in enumerate(zip([*net.hidden, net.out], DILATIONS, strict=True)):
        kernel = torch.zeros(*layer.weight.shape[:2], 2 * step + 1, 2 * step + 1)
        kernel[:, :, ::step, ::step] = layer.weight
        maps = functional.conv2d(maps, kernel, layer.bias)
        maps = maps if index == len(net.hidden) else maps.clamp(min=0)
    assert maps.shape == (1, 64, 1, 1)
    return maps[0, :, 0, 0] / maps.norm()


def literal_volume(net: DescriptorNet, channels: np.ndarray, disparities: range) -> np.ndarray:
    height, width = channels.shape[2:]
    padded = torch.from_numpy(np.pad(channels, ((0, 0), (0, 0), (REACH, REACH), (REACH, REACH)), mode="edge"))
    side = 2 * REACH + 1
    described = [
        [[literal_descriptor(net, view[:, y : y + side, x : x + side]) for x in range(width)] for y in range(height)]
        for view in padded
    ]
    volume = np.full((height, width, len(disparities)), np.nan, np.float32)
    for y, x, index in np.ndindex(volume.shape):
        matched = x - disparities[index]
        if 0 <= matched < width:
            product = float(described[0][y][x] @ described[1][y][matched])
            volume[y, x, index] = float(net.bias) - np.exp(float(net.log_scale)) * product
    return volume


@pytest.mark.parametrize(
    ("channels", "disparities"),
    [
        pytest.param(3, range(0, 9), id="the usual"),
        pytest.param(1, range(-5, 6), id="negative disparities: both borders"),
        pytest.param(2, range(-40, 41), id="a range wider than the image"),
        pytest.param(1, range(4, 9), id="none near zero"),
        pytest.param(1, range(-9, -4), id="negative ones alone"),
        pytest.param(1, range(30, 33), id="no cell at all"),
    ],
)
def test_the_volume_is_that_of_single_patches(channels: int, disparities: range) -> None:
    net, given = random_descriptor_net(channels), views(channels)
    made, expected = fast_cost_volume(net, given, disparities), literal_volume(net, given, disparities)
    assert made.dtype == np.float32 and made.shape == expected.shape
    assert np.array_equal(np.isnan(made), np.isnan(expected))
    assert np.allclose(made, expected, atol=1e-4, equal_nan=True)


def test_the_blocks_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    net, given = random_descriptor_net(), views(width=40)
    expected = fast_cost_volume(net, given, range(-3, 7))
    monkeypatch.setattr(module, "COLUMNS", 7)
    assert np.allclose(fast_cost_volume(net, given, range(-3, 7)), expected, atol=1e-5, equal_nan=True)


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_equal_views_match_at_zero(precision: Precision) -> None:
    """Whatever the weights: no descriptor is nearer to one than it is itself."""
    net, given = random_descriptor_net(), views(width=40)
    costs = fast_cost_volume(net, given[:1].repeat(2, 0), range(-3, 4), precision)
    assert (np.nanargmin(costs, 2) == 3).all()
    assert costs[..., 3] == pytest.approx(float(net.bias) - np.exp(float(net.log_scale)), abs=1e-4)


def test_bfloat16_is_near_float32() -> None:
    net, given = random_descriptor_net(), views(width=40)
    one, other = (fast_cost_volume(net, given, range(6), precision) for precision in ("float32", "bfloat16"))
    assert 0 < np.nanmax(np.abs(one - other)) < 0.5


def test_tiles_equal_the_whole() -> None:
    given = {
        "channels": shifted_scene(height=23, width=40)["channels"],
        "descriptor_net": {"parameters": to_vector(random_descriptor_net())},
    }
    params = CostVolumeParams(d_min=-2, d_max=9, precision="float32", mode="fast")
    one, other = tiled(COST_VOLUME, params, given, DIMS, 8), whole(COST_VOLUME, params, given, DIMS)
    assert np.array_equal(one["d"], other["d"]) and other["cost"].dtype == np.float16
    assert np.allclose(one["cost"], other["cost"], rtol=2**-9, atol=1e-3, equal_nan=True)


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_chunks_that_a_tile_makes_together_are_those_it_makes_alone(precision: Precision) -> None:
    """To the rounding of a float16: the products of matrices of another size may add in another order."""
    given = {
        "channels": shifted_scene(height=70, width=40)["channels"],
        "descriptor_net": {"parameters": to_vector(random_descriptor_net())},
    }
    params = CostVolumeParams(d_min=-2, d_max=9, precision=precision, mode="fast")
    one, other = (tiled(COST_VOLUME, params, given, DIMS, rows)["cost"] for rows in (CHUNK, 3 * CHUNK))
    assert np.allclose(one, other, rtol=2**-10, atol=1e-3, equal_nan=True)


def test_diagonals_by_hand() -> None:
    products = torch.arange(8.0).reshape(1, 2, 4)
    assert diagonals(products, 3).tolist() == [[[0, 1, 2], [5, 6, 7]]]
    assert diagonals(products.expand(2, 2, 4), 3).shape == (2, 2, 3)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        pytest.param((2, 2, 5, 6), r"expects 2 views of 3 channels, got \(2, 2\)", id="another channel count"),
        pytest.param((3, 5, 6), r"channels has shape \(3, 5, 6\), expected 4 dimensions", id="no axis of views"),
    ],
)
def test_refuses_other_shapes(shape: tuple[int, ...], message: str) -> None:
    with pytest.raises(StageError, match=message):
        fast_cost_volume(random_descriptor_net(), np.zeros(shape, np.float32), range(3))


@pytest.mark.parametrize("width", get_args(Width))
def test_parameters_make_the_net_again_for_the_same_channels_only(width: Width) -> None:
    vector = to_vector(random_descriptor_net(2, width))
    made = descriptor_net_from_parameters(vector, 2)
    assert made.width == width
    assert np.array_equal(to_vector(made), vector)
    with pytest.raises(StageError, match=r"do not fit 3 channel\(s\) a view: it was trained on other channels"):
        descriptor_net_from_parameters(vector, 3)
    with pytest.raises(StageError, match="at least one channel, got 0"):
        DescriptorNet(0)


def test_the_context_is_what_the_stage_asks_for() -> None:
    assert COST_VOLUME.halo(CostVolumeParams(mode="fast")) == REACH == sum(DILATIONS)
