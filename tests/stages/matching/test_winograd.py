import numpy as np
import pytest
import torch
from torch.nn import functional

from stages.matching.net import SIDES
from stages.matching.winograd import (
    POINTS,
    TILE,
    TransformedNet,
    forward6,
    forward8,
    inverse6,
    inverse8,
    spread,
)
from tests.stages.matching.reference import random_net

TRANSFORMS = {3: (forward6, inverse6), 5: (forward8, inverse8)}


def matrix(transform: object, length: int) -> np.ndarray:
    """Return a linear transform as a matrix."""
    return np.array(transform(*np.eye(length)), np.float64)  # type: ignore[operator]


@pytest.mark.parametrize("side", [3, 5])
def test_a_tile_filtered_in_the_transformed_domain_is_filtered(side: int) -> None:
    rng = np.random.default_rng(side)
    length = side + TILE - 1
    weight = torch.from_numpy(rng.normal(size=(2, 3, side, side)))
    tile = torch.from_numpy(rng.normal(size=(3, length, length)))
    forward, inverse = (matrix(each, length) for each in TRANSFORMS[side])
    numbers = (forward @ tile.numpy() @ forward.T).reshape(3, -1)  # channel number
    products = np.einsum("cn,nco->on", numbers, spread(weight).numpy()).reshape(2, length, length)
    made = inverse @ products @ inverse.T
    expected = functional.conv2d(tile[None], weight)[0].numpy()
    assert made.shape == expected.shape == (2, TILE, TILE)
    assert np.abs(made - expected).max() <= 1e-5, "spread rounds to float32"


@pytest.mark.parametrize("side", [3, 5])
def test_the_inverse_takes_powers_of_the_points(side: int) -> None:
    """Row i of A is the i-th power of each point; infinity adds to the last row alone."""
    _, inverse = TRANSFORMS[side]
    powers = np.array(POINTS[side])[None, :] ** np.arange(TILE)[:, None]
    assert np.array_equal(matrix(inverse, side + TILE - 1), np.column_stack([powers, [0, 0, 0, 1]]))


@pytest.mark.parametrize(
    ("channels", "tiles", "corners"),
    [
        pytest.param(1, (1, 1), (0, 0, 0), id="one tile, one channel"),
        pytest.param(3, (2, 3), (0, 0, 0), id="from the corner"),
        pytest.param(3, (1, 2), (3, 5, 2), id="from elsewhere, shifted to the left"),
        pytest.param(2, (2, 1), (1, 0, 6), id="shifted to the right"),
    ],
)
def test_equals_the_direct_convolutions(channels: int, tiles: tuple[int, int], corners: tuple[int, int, int]) -> None:
    """Against the network itself in float64; the direct way in float32 errs too, by about half as much."""
    net = random_net(channels)
    views = torch.from_numpy(np.random.default_rng(1).normal(size=(2, channels, 26, 32)).astype(np.float32))
    with torch.inference_mode():
        maps = [net.embed_layers(view[None], side) for view, side in zip(views, SIDES, strict=True)]
        left, right = (each.permute(0, 2, 3, 1).contiguous().numpy() for each in maps)
        made = TransformedNet.of(net).log_odds(left, right, corners, tiles)
        rows, columns = (TILE * count + 6 for count in tiles)
        y, *starts = corners
        one, other = (
            each.reshape(1, -1, *each.shape[2:])[..., y : y + rows, x : x + columns]
            for each, x in zip(maps, starts, strict=True)
        )
        expected = net.double().join(one.double(), other.double())[0]
    assert made.shape == (TILE * tiles[0], TILE * tiles[1]) and made.dtype == np.float32
    assert np.abs(made - (expected[1] - expected[0]).numpy()).max() <= 1e-4
