import numpy as np
import pytest
import torch

from semidense.stages.matching.declaration import REACH
from semidense.stages.matching.descriptors import view as module
from semidense.stages.matching.descriptors.declaration import WIDTH, Width
from semidense.stages.matching.descriptors.view import described_views
from tests.stages.matching.descriptors.test_volume import random_descriptor_net


def padded_views(height: int, width: int) -> np.ndarray:
    """Return two views of random numbers with what a descriptor sees around them."""
    return np.random.default_rng(0).normal(size=(2, 3, height + 2 * REACH, width + 2 * REACH)).astype(np.float32)


@pytest.mark.parametrize(
    ("precision", "bound"),
    [
        pytest.param("float32", 2e-6, id="float32"),
        pytest.param("bfloat16", 0.02, id="bfloat16: 8 bits of each number"),
    ],
)
@pytest.mark.parametrize(("height", "width"), [(1, 1), (21, 38)])
@pytest.mark.parametrize("filters", [WIDTH, 128])
def test_the_descriptors_are_those_of_the_network(
    precision: module.Precision, bound: float, height: int, width: int, filters: Width
) -> None:
    net, views = random_descriptor_net(width=filters), padded_views(height, width)
    with torch.inference_mode():
        made, expected = described_views(net, views, precision), net(torch.from_numpy(views)).permute(0, 2, 3, 1)
    for one, other in zip(made, expected, strict=True):
        assert one.dtype == torch.float32 and one.shape == (height, width, filters)
        assert torch.allclose(one, other, atol=bound)
        assert torch.allclose(one.norm(dim=2), torch.ones(height, width), atol=1e-5)


def test_plain_descriptors_do_not_depend_on_how_many_rows_are_made_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    net, views = random_descriptor_net(), padded_views(23, 38)
    with torch.inference_mode():
        expected = described_views(net, views, "bfloat16")
        monkeypatch.setattr(module, "ROWS", 5)
        made = described_views(net, views, "bfloat16")
    assert all(torch.equal(one, other) for one, other in zip(made, expected, strict=True))
