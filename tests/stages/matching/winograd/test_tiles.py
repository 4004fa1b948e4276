from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch.nn import functional

from semidense.stages.compute.kernel import kernel
from semidense.stages.matching.winograd import tiles as winograd
from semidense.stages.matching.winograd.tiles import (
    POINTS,
    TILE,
    forward6,
    forward8,
    inverse6,
    inverse8,
    load4,
    load6,
    load8,
    spread,
    store4,
    store6,
    store8,
)

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


@kernel
def _copied4(given: np.ndarray, out: np.ndarray) -> None:
    store4(out, 5, 3, load4(given, 5, 3))


@kernel
def _copied6(given: np.ndarray, out: np.ndarray) -> None:
    store6(out, 5, 3, load6(given, 5, 3))


@kernel
def _copied8(given: np.ndarray, out: np.ndarray) -> None:
    store8(out, 5, 3, load8(given, 5, 3))


@pytest.mark.parametrize(("count", "copied"), [(4, _copied4), (6, _copied6), (8, _copied8)])
def test_numbers_are_loaded_and_stored_by_channel(count: int, copied: Callable) -> None:
    given, out = np.arange(1, count * 5 + 1, dtype=np.float32), np.zeros(count * 5, np.float32)
    copied(given, out)
    expected = np.zeros_like(given)
    expected[3::5] = given[3::5]
    assert np.array_equal(out, expected)


def test_gradients_flow_through_spread() -> None:
    weight = torch.randn(2, 3, 5, 5, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(spread, (weight,))
