import pytest
import torch

from semidense.stages.matching.declaration import DILATIONS, REACH
from semidense.stages.matching.descriptors import transformed as module
from semidense.stages.matching.descriptors import transformed_training as training
from semidense.stages.matching.descriptors.declaration import WIDTH, Width
from semidense.stages.matching.descriptors.net import DescriptorNet
from semidense.stages.matching.descriptors.transformed import WHOLE, kernels_of, transformed_descriptors
from semidense.stages.matching.descriptors.transformed_training import differentiable
from tests.stages.matching.descriptors.test_volume import random_descriptor_net


@pytest.mark.parametrize(
    ("height", "width"),
    [
        pytest.param(WHOLE, 2 * WHOLE, id="whole tiles of every layer"),
        pytest.param(1, 1, id="a single pixel"),
        pytest.param(WHOLE + 1, WHOLE - 1, id="one more row, one column less"),
        pytest.param(21, 38, id="no multiple of anything"),
    ],
)
@pytest.mark.parametrize("filters", [32, WIDTH, 96])
@pytest.mark.parametrize("tiles", [pytest.param(5, id="few at once"), pytest.param(module.TILES, id="as it is")])
def test_the_descriptors_are_those_of_plain_convolutions(
    height: int, width: int, tiles: int, filters: Width, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "TILES", tiles)
    net = random_descriptor_net(width=filters)
    view = torch.randn(3, height + 2 * REACH, width + 2 * REACH, generator=torch.Generator().manual_seed(0))
    made, expected = transformed_descriptors(net, kernels_of(net), view), net(view[None])[0].permute(1, 2, 0)
    assert made.shape == (height, width, filters)
    assert torch.allclose(made, expected, atol=2e-6)


def test_what_lies_beyond_the_view_does_not_matter() -> None:
    """The view is made up to whole tiles; a wrong number there must not reach a descriptor."""
    net = random_descriptor_net()
    view = torch.randn(3, 2 * REACH + 30, 2 * REACH + 30, generator=torch.Generator().manual_seed(0))
    part = transformed_descriptors(net, kernels_of(net), view[:, : 2 * REACH + 7, : 2 * REACH + 9])
    assert torch.allclose(part, transformed_descriptors(net, kernels_of(net), view)[:7, :9], atol=2e-6)


def test_every_layer_has_whole_tiles() -> None:
    """What the making up of the view to a multiple of ``WHOLE`` relies on."""
    length = WHOLE + 2 * REACH - 2 * DILATIONS[0]
    for step in DILATIONS[1:]:
        length -= 2 * step
        assert length % (module.TILE * step) == 0
    assert length == WHOLE


@pytest.mark.parametrize("filters", [32, WIDTH, 96])
@pytest.mark.parametrize(
    ("tiles", "lift", "bound"),
    [
        pytest.param(module.TILES, 0.0, 1e-2, id="a unit near zero may be cut on one side alone"),
        pytest.param(module.TILES, 30.0, 1e-5, id="no unit is cut"),
        pytest.param(5, 30.0, 1e-5, id="few tiles at once"),
    ],
)
def test_the_gradients_are_those_of_plain_convolutions(
    tiles: int, lift: float, bound: float, filters: Width, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "TILES", tiles)
    monkeypatch.setattr(training, "TILES", tiles)
    net = random_descriptor_net(width=filters)
    for layer in net.hidden:
        layer.bias += lift
    net.requires_grad_()
    generator = torch.Generator().manual_seed(0)
    view = torch.randn(3, 21 + 2 * REACH, 38 + 2 * REACH, generator=generator, requires_grad=True)
    wanted = torch.randn(21, 38, filters, generator=generator)
    made, expected = (
        torch.autograd.grad((descriptors * wanted).sum(), [view, *described_by(net)])
        for descriptors in (
            transformed_descriptors(net, kernels_of(net), view, differentiable),
            net(view[None])[0].permute(1, 2, 0),
        )
    )
    for one, other in zip(made, expected, strict=True):
        assert (one - other).norm() <= bound * other.norm()


def described_by(net: DescriptorNet) -> list[torch.Tensor]:
    """Return what has a part in the descriptors: all parameters but those of ``log_odds``."""
    return [parameter for name, parameter in net.named_parameters() if name not in {"log_scale", "bias"}]
