import numpy as np
import pytest
import torch
from torch import Tensor, nn

from semidense.stages.learning.optimiser import Muon, optimisers_of, orthogonal
from semidense.stages.learning.schedule import Schedule

Shape = tuple[int, ...]


def matrix(shape: Shape, seed: int = 0) -> Tensor:
    return torch.from_numpy(np.random.default_rng(seed).normal(size=shape).astype(np.float32))


@pytest.mark.parametrize(
    "shape",
    [
        pytest.param((4, 9), id="wide"),
        pytest.param((9, 4), id="tall"),
        pytest.param((5, 5), id="square"),
        pytest.param((1, 7), id="one row: its direction"),
        pytest.param((64, 3456), id="conv3 of the matching-Net"),
    ],
)
def test_the_orthogonal_part_is_that_of_the_singular_value_decomposition(shape: Shape) -> None:
    given = matrix(shape)
    u, _, v = np.linalg.svd(given.numpy().astype(np.float64), full_matrices=False)
    assert np.abs(orthogonal(given).numpy() - u @ v).max() < 1e-3


def test_a_diagonal_by_hand() -> None:
    made = orthogonal(torch.diag(torch.tensor([4.0, -0.5, 2.0])))
    assert torch.allclose(made, torch.diag(torch.tensor([1.0, -1.0, 1.0])), atol=1e-5)


@pytest.mark.parametrize("factor", [1e-12, 1.0, 1e12])
def test_the_size_of_a_gradient_does_not_matter(factor: float) -> None:
    assert torch.allclose(orthogonal(matrix((8, 40)) * factor), orthogonal(matrix((8, 40))), atol=1e-4)


def test_zeros_stay_zeros() -> None:
    assert not orthogonal(torch.zeros(3, 8)).any()


def test_a_direction_that_is_missing_stays_small() -> None:
    made = orthogonal(matrix((8, 1)) @ matrix((1, 40), 1))
    assert torch.linalg.svdvals(made)[0].item() == pytest.approx(1, abs=1e-3)
    assert made.isfinite().all() and torch.linalg.matrix_norm(made).item() < 1.2


def test_where_float32_fails_float64_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """As LAPACK's does for a few matrices of low rank: which ones depends on the processor and on the threads."""
    given, solve = matrix((8, 40)), torch.linalg.eigh
    expected = orthogonal(given)

    def failing(symmetric: Tensor) -> tuple[Tensor, Tensor]:
        values, vectors = solve(symmetric)
        if symmetric.dtype == torch.float32:
            values[-1], vectors[0, 0] = torch.nan, torch.nan
        return values, vectors

    monkeypatch.setattr(torch.linalg, "eigh", failing)
    assert torch.allclose(orthogonal(given), expected, atol=1e-5)


def test_the_first_step_is_the_gradients_orthogonal_part_at_the_size_of_adams() -> None:
    parameter = nn.Parameter(torch.zeros(40, 4, 3, 3))
    parameter.grad = matrix((40, 4, 3, 3))
    Muon([parameter], lr=0.01).step()
    expected = -0.01 * 0.2 * 40**0.5 * orthogonal(parameter.grad.reshape(40, 36))
    assert torch.allclose(parameter.detach().reshape(40, 36), expected, atol=1e-6)


def test_what_gradients_have_in_common_outweighs_what_they_have_not() -> None:
    parameter = nn.Parameter(torch.zeros(2, 2))
    muon = Muon([parameter], lr=1.0)
    for sign in (1.0, -1.0) * 20:
        parameter.grad = torch.tensor([[1.0, 0.0], [0.0, sign * 0.3]])
        muon.step()
    first, second = parameter.detach().diagonal()
    assert abs(first) > 5 * abs(second)


def test_a_step_does_not_depend_on_the_order_in_memory() -> None:
    moved = []
    for layout in (torch.contiguous_format, torch.channels_last):
        parameter = nn.Parameter(matrix((32, 8, 3, 3), 1).to(memory_format=layout))
        parameter.grad = matrix((32, 8, 3, 3), 2).to(memory_format=layout)
        Muon([parameter], lr=0.01).step()
        moved.append(parameter.detach())
    assert torch.equal(*moved)


class Layers(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.first = nn.Conv2d(1, 32, 3)
        self.large = nn.Conv2d(32, 64, 3)
        self.out = nn.Linear(64, 2)


@pytest.mark.parametrize(
    ("optimiser", "expected"),
    [
        pytest.param("muon", {"large.weight"}, id="kernels with many filters of many inputs"),
        pytest.param("adam", set(), id="none"),
    ],
)
def test_which_parameters_are_muons(optimiser: str, expected: set[str]) -> None:
    net = Layers()
    made = optimisers_of(net, Schedule(optimiser=optimiser))
    names = {id(parameter): name for name, parameter in net.named_parameters()}
    found = {type(each).__name__: {names[id(one)] for one in each.param_groups[0]["params"]} for each in made}
    assert found.get("Muon", set()) == expected
    assert found["Adam"] == set(names.values()) - expected


def test_a_net_of_large_kernels_alone_needs_no_adam() -> None:
    assert [type(each) for each in optimisers_of(nn.Linear(64, 64, bias=False), Schedule())] == [Muon]
