import numpy as np
import pytest
import torch
from torch import nn

from semidense.stages.evaluation.net import EvaluationNet
from semidense.stages.learning.parameters import count, from_vector, initialise, to_vector, unset
from semidense.stages.matching.net import MatchingNet
from semidense.stages.stage import StageError

networks = pytest.mark.parametrize("network", [MatchingNet, EvaluationNet])


@networks
def test_the_round_trip_is_exact(network: type[nn.Module]) -> None:
    one, other = network(), network()
    vector = np.random.default_rng(0).normal(size=count(one)).astype(np.float32)
    from_vector(one, vector)
    assert np.array_equal(to_vector(one), vector) and to_vector(one).dtype == np.float32
    from_vector(other, to_vector(one))
    assert all(torch.equal(a, b) for a, b in zip(one.state_dict().values(), other.state_dict().values(), strict=True))


def test_a_network_in_another_memory_layout_gives_the_same_vector() -> None:
    net = MatchingNet()
    assert np.array_equal(to_vector(net), to_vector(net.to(memory_format=torch.channels_last)))


def test_the_vector_holds_the_buffers_too() -> None:
    net = MatchingNet(2)
    assert count(net) == sum(parameter.numel() for parameter in net.parameters()) + 4


def test_the_network_does_not_share_the_vectors_memory() -> None:
    net = EvaluationNet()
    vector = np.zeros(count(net), np.float32)
    from_vector(net, vector)
    vector[:] = 1
    assert not to_vector(net).any()


def test_a_network_that_is_yet_to_be_set_draws_nothing_from_torchs_global_generator() -> None:
    torch.manual_seed(0)
    expected = torch.rand(1)
    torch.manual_seed(0)
    net = unset(EvaluationNet)
    assert torch.rand(1) == expected
    other = EvaluationNet()
    from_vector(net, to_vector(other))
    assert all(torch.equal(one, two) for one, two in zip(net.parameters(), other.parameters(), strict=True))


@networks
def test_one_seed_gives_one_network_whatever_torch_has_drawn(network: type[nn.Module]) -> None:
    vectors = []
    for seed, drawn in ((3, 0), (3, 1), (4, 0)):
        torch.manual_seed(drawn)
        net = network()
        initialise(net, seed)
        vectors.append(to_vector(net))
    assert np.array_equal(vectors[0], vectors[1])
    assert not np.array_equal(vectors[0], vectors[2])


def test_weights_are_he_normal_biases_zero_and_the_output_a_tenth() -> None:
    net = EvaluationNet()
    initialise(net, 0)
    assert net.conv4_gray.weight.std().item() == pytest.approx((2 / (64 * 9)) ** 0.5, rel=0.02)
    assert net.fc.weight.std().item() == pytest.approx((2 / 2048) ** 0.5, rel=0.02)
    assert net.out.weight.std().item() == pytest.approx(0.1 * (2 / 128) ** 0.5, rel=0.15)
    assert not any(parameter.any() for name, parameter in net.named_parameters() if name.endswith("bias"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        pytest.param(lambda v: v[:-1], "has 433410 parameters, the weights hold 433409", id="one too few"),
        pytest.param(lambda v: np.append(v, v[:1]), "made with another head or other channels", id="one too many"),
        pytest.param(lambda v: v[None], "parameters, the weights hold", id="another shape"),
        pytest.param(lambda v: np.where(np.arange(v.size) == 5, np.nan, v), "a value that is not finite", id="NaN"),
        pytest.param(
            lambda v: np.where(np.arange(v.size) == 5, np.inf, v), "a value that is not finite", id="infinity"
        ),
    ],
)
def test_refuses(change: object, message: str) -> None:
    net = EvaluationNet()
    before = to_vector(net)
    with pytest.raises(StageError, match=message) as error:
        from_vector(net, change(before).astype(np.float32))
    assert "\n" not in str(error.value)
    assert np.array_equal(to_vector(net), before), "nothing has changed"
