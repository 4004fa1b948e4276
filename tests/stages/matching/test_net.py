import numpy as np
import pytest
import torch

from semidense.stages.compute.precision import autocast
from semidense.stages.learning.parameters import count, to_vector
from semidense.stages.matching.declaration import Head
from semidense.stages.matching.net import HEADS, MatchingNet, net_from_parameters
from semidense.stages.stage import StageError
from tests.stages.matching.reference import NETS, literal_logits, patches, random_net

every_net = pytest.mark.parametrize(("channels", "head"), NETS)


@every_net
def test_one_patch_is_the_papers_network(channels: int, head: Head) -> None:
    net = random_net(channels, head)
    left, right = torch.randn(2, 40, channels, 11, 11, generator=torch.Generator().manual_seed(2))
    expected = literal_logits(net, left, right)
    made = net(left, right).detach()
    assert made.shape == (40, 2, 1, 1) and made.dtype == torch.float32
    assert (made[:, :, 0, 0] - expected).abs().max() <= 1e-4
    assert expected.std(0).min() > 0.1, "the answers differ enough for the comparison to mean something"


@every_net
def test_a_larger_input_gives_the_answers_of_all_its_patches(channels: int, head: Head) -> None:
    net = random_net(channels, head, seed=1)
    views = np.random.default_rng(0).normal(size=(2, channels, 8, 13)).astype(np.float32)
    left, right = (patches(view).flatten(0, 1) for view in views)
    expected = literal_logits(net, left, right).reshape(8, 13, 2)
    padded = torch.from_numpy(np.pad(views, ((0, 0), (0, 0), (5, 5), (5, 5)), mode="edge"))
    made = net(padded[:1], padded[1:]).detach()[0].permute(1, 2, 0)
    assert made.shape == (8, 13, 2)
    assert (made - expected).abs().max() <= 1e-4


@pytest.mark.parametrize("head", HEADS)
def test_the_log_odds_are_the_difference_of_the_outputs(head: Head) -> None:
    net = random_net(2, head)
    joined = torch.rand(2, 256, 9, 12, generator=torch.Generator().manual_seed(3))
    with torch.inference_mode():
        logits, made = net.out(net.describe(joined)), net.log_odds(joined)
    assert made.shape == (2, 3, 6)
    assert (made - (logits[:, 1] - logits[:, 0])).abs().max() <= 1e-4


def test_the_log_odds_keep_their_bits_in_bfloat16() -> None:
    """Rounded to bfloat16, neighbouring costs would tie."""
    net = random_net()
    with torch.inference_mode(), autocast("bfloat16"):
        made = net.log_odds(torch.rand(1, 384, 12, 12, generator=torch.Generator().manual_seed(4)))
    assert made.dtype == torch.float32
    assert (made != made.bfloat16().float()).float().mean() > 0.9


def test_features_are_never_negative_and_have_the_documented_shape() -> None:
    net = random_net()
    features = net.describe(torch.rand(2, 384, 8, 9))
    assert features.shape == (2, 128, 2, 3) and features.min() == 0 < features.max()
    assert net.embed(torch.rand(2, 3, 12, 13), "left").shape == (2, 384, 8, 9)


@pytest.mark.parametrize(
    ("channels", "head", "after_conv2"),
    [
        pytest.param(3, "compact", (221_248, 204_928, 258, 6), id="1600 -> 128 -> 2"),
        pytest.param(3, "paper", (221_248, 2_561_600, 204_928, 258, 6), id="1600 -> 1600 -> 128 -> 2"),
        pytest.param(1, "compact", (73_792, 204_928, 258, 2), id="one channel: conv3 has a third of the weights"),
    ],
)
def test_the_number_of_parameters_by_hand(channels: int, head: Head, after_conv2: tuple[int, ...]) -> None:
    conv1, conv2 = 32 * 9 + 32, 128 * 32 * 2 * 9 + 128
    assert count(MatchingNet(channels, head)) == conv1 + conv2 + sum(after_conv2)


@every_net
def test_a_vector_of_parameters_tells_its_head(channels: int, head: Head) -> None:
    net = random_net(channels, head)
    again = net_from_parameters(to_vector(net), channels)
    assert np.array_equal(to_vector(again), to_vector(net))
    assert len(again.hidden) == {"compact": 1, "paper": 2}[head]


def test_refuses_parameters_of_other_channels() -> None:
    with pytest.raises(
        StageError, match=r"parameters do not fit 3 channel\(s\) a view: it was trained on other"
    ) as error:
        net_from_parameters(to_vector(random_net(2)), 3)
    assert "\n" not in str(error.value)


def test_refuses_no_channel_and_an_unknown_head() -> None:
    with pytest.raises(StageError, match="at least one channel, got 0"):
        MatchingNet(0)
    with pytest.raises(StageError, match="no head 'wide': use 'compact' or 'paper'"):
        MatchingNet(3, "wide")  # type: ignore[arg-type]
