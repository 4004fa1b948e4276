from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch.nn import functional

from stages.matching import winograd
from stages.matching.winograd import POINTS, TILE, forward6, forward8, inverse6, inverse8, spread

TRANSFORMS = {3: (forward6, inverse6), 5: (forward8, inverse8)}


def matrix(transform: Callable, length: int) -> np.ndarray:
    """Return a linear transform as a matrix."""
    return np.array(transform(tuple(np.eye(length))), np.float64)


@pytest.mark.parametrize("taps", [3, 5])
def test_a_tile_filtered_in_the_transformed_domain_is_filtered(taps: int) -> None:
    rng = np.random.default_rng(taps)
    length = taps + TILE - 1
    weight = torch.from_numpy(rng.normal(size=(2, 3, taps, taps)))
    tile = torch.from_numpy(rng.normal(size=(3, length, length)))
    forward, inverse = (matrix(each, length) for each in TRANSFORMS[taps])
    numbers = (forward @ tile.numpy() @ forward.T).reshape(3, -1)  # channel number
    products = np.einsum("cn,nco->on", numbers, spread(weight).numpy()).reshape(2, length, length)
    made = inverse @ products @ inverse.T
    expected = functional.conv2d(tile[None], weight)[0].numpy()
    assert made.shape == expected.shape == (2, TILE, TILE)
    assert np.abs(made - expected).max() <= 1e-12


@pytest.mark.parametrize("taps", [3, 5])
def test_the_inverse_takes_powers_of_the_points(taps: int) -> None:
    """Row i of A' is the i-th power of each point; infinity adds to the last row alone."""
    _, inverse = TRANSFORMS[taps]
    powers = np.array(POINTS[taps])[None, :] ** np.arange(TILE)[:, None]
    assert np.array_equal(matrix(inverse, taps + TILE - 1), np.column_stack([powers, [0, 0, 0, 1]]))


@pytest.mark.parametrize("name", ["forward6", "inverse6", "forward8", "inverse8"])
def test_gradients_go_back_by_the_transpose(name: str) -> None:
    length = int(name[-1])
    there = matrix(getattr(winograd, name), length)
    back = matrix(getattr(winograd, f"{name}_transposed"), len(there))
    assert np.array_equal(back, there.T)


@pytest.mark.parametrize("count", [4, 6, 8])
def test_numbers_are_loaded_and_stored_by_channel(count: int) -> None:
    given = np.arange(count * 5, dtype=np.float32)
    loaded = getattr(winograd, f"load{count}")(given, 5, 3)
    assert loaded == tuple(range(3, count * 5, 5))
    stored = np.zeros_like(given)
    getattr(winograd, f"store{count}")(stored, 5, 3, loaded)
    assert np.array_equal(np.flatnonzero(stored), np.arange(3, count * 5, 5))


def test_gradients_flow_through_spread() -> None:
    weight = torch.randn(2, 3, 5, 5, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(spread, (weight,))
