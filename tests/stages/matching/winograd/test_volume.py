import numpy as np
import pytest
import torch

from semidense.stages.matching.net import SIDES
from semidense.stages.matching.winograd.tiles import TILE
from semidense.stages.matching.winograd.volume import TransformedNet, is_transformable, run_blocks
from tests.stages.matching.reference import random_net


@pytest.mark.parametrize(
    ("channels", "tiles", "corners"),
    [
        pytest.param(1, (1, 1), [(0, 0, 0)], id="one tile, one channel"),
        pytest.param(3, (2, 3), [(0, 0, 0)], id="from the corner"),
        pytest.param(3, (1, 2), [(3, 5, 2)], id="from elsewhere, shifted to the left"),
        pytest.param(2, (2, 1), [(1, 0, 6)], id="shifted to the right"),
        pytest.param(3, (2, 3), [(1, 0, 6), (0, 0, 0), (3, 5, 2)], id="three blocks at once"),
    ],
)
def test_equals_the_direct_convolutions(
    channels: int, tiles: tuple[int, int], corners: list[tuple[int, int, int]]
) -> None:
    """Against the network itself in float64; the direct way in float32 errs too."""
    net = random_net(channels)
    views = torch.from_numpy(np.random.default_rng(1).normal(size=(2, channels, 26, 32)).astype(np.float32))
    with torch.inference_mode():
        maps = [net.embed_layers(view[None], side) for view, side in zip(views, SIDES, strict=True)]
        left, right = (each.permute(0, 2, 3, 1).contiguous() for each in maps)
        made = net.odds_of_features(run_blocks(TransformedNet.of(net), left, right, corners, tiles).units)
        rows, columns = (TILE * count + 6 for count in tiles)
        expected = []
        for y, *starts in corners:
            one, other = (
                each.double().reshape(1, -1, *each.shape[2:])[..., y : y + rows, x : x + columns]
                for each, x in zip(maps, starts, strict=True)
            )
            logits = random_net(channels).double().join(one, other)[0]
            expected.append(logits[1] - logits[0])
    assert made.shape == (len(corners), TILE * tiles[0], TILE * tiles[1]) and made.dtype == torch.float32
    assert (made - torch.stack(expected)).abs().max() <= 1e-4


def test_only_the_compact_head_is_transformed() -> None:
    assert is_transformable(random_net(1))
    assert not is_transformable(random_net(1, "paper"))


def test_in_bfloat16_what_is_multiplied_is_rounded_and_nothing_else() -> None:
    views = torch.from_numpy(np.random.default_rng(1).normal(size=(2, 1, 14, 14, 128)).astype(np.float32))
    with torch.inference_mode():
        exact, rounded = (
            run_blocks(TransformedNet.of(random_net(1), dtype), *views, [(0, 0, 0)], (2, 2))
            for dtype in (torch.float32, torch.bfloat16)
        )
    assert rounded.split.dtype == torch.bfloat16
    for one, other in ((exact.features, rounded.features), (exact.units, rounded.units)):
        assert other.dtype == torch.float32 and not torch.equal(other, other.bfloat16().float())
        assert 0 < (one - other).abs().mean() <= 0.05 * one.std()
