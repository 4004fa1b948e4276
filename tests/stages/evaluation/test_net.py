from typing import Literal

import numpy as np
import pytest
import torch

from semidense.stages.evaluation.net import EvaluationNet, fragments, interleave
from semidense.stages.learning.parameters import count
from tests.stages.evaluation.reference import literal_log_odds, literal_logits, random_layers, random_net


def tensor(layers: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(layers).unsqueeze(0)


def test_one_patch_is_the_papers_network() -> None:
    net = random_net()
    patches = torch.randn(3, 2, 101, 101, generator=torch.Generator().manual_seed(1))
    expected = literal_logits(net, patches)
    made = net(patches).detach()
    assert made.shape == (3, 2, 1, 1) and made.dtype == torch.float32
    assert (made[:, :, 0, 0] - expected).abs().max() <= 1e-4
    assert expected.std(0).min() > 0.1, "the answers differ enough for the comparison to mean something"


def test_the_number_of_parameters_by_hand() -> None:
    towers = (16 * 9 + 16) + (32 * 16 * 9 + 32) + (64 * 32 * 9 + 64)
    assert count(EvaluationNet()) == towers + (128 * 64 * 2 * 9 + 128) + (128 * 2048 + 128) + (2 * 128 + 2)


def test_a_larger_map_gives_the_patches_16_px_apart() -> None:
    net, layers = random_net(), random_layers(101 + 16, 101 + 2 * 16)
    corners = np.array([(y, x) for y in (0, 16) for x in (0, 16, 32)])
    made = net(tensor(layers)).detach()
    assert made.shape == (1, 2, 2, 3)
    expected = literal_log_odds(net, layers, corners).reshape(2, 3)
    assert np.abs((made[0, 1] - made[0, 0]).numpy() - expected).max() <= 1e-4


@pytest.mark.parametrize(
    ("length", "answers"),
    [(94, 1), (101, 1), (109, 1), (110, 2), (117, 2), (125, 2), (126, 3)],
)
def test_the_number_of_answers(length: int, answers: int) -> None:
    with torch.inference_mode():
        assert random_net()(torch.zeros(1, 2, length, 94)).shape == (1, 2, answers, 1)


@pytest.mark.parametrize(
    ("height", "width"),
    [
        pytest.param(101, 101, id="a single patch"),
        pytest.param(102, 103, id="even and odd"),
        pytest.param(105, 104, id="odd and even"),
        pytest.param(108, 118, id="both even, more than a stride across"),
        pytest.param(119, 105, id="both odd, more than a stride down"),
    ],
)
def test_dense_gives_the_patch_at_every_pixel(height: int, width: int) -> None:
    net, layers = random_net(), random_layers(height, width)
    corners = np.array([(y, x) for y in range(height - 100) for x in range(width - 100)])
    chosen = np.random.default_rng(0).permutation(len(corners))[:40]  # enough to meet any order of 16 offsets
    ends = [0, width - 101, len(corners) - 1]
    corners = corners[np.union1d(chosen, ends)]
    with torch.inference_mode():
        made = net.dense(tensor(layers)).numpy()
    assert made.shape == (height - 100, width - 100) and made.dtype == np.float32
    assert np.abs(made[tuple(corners.T)] - literal_log_odds(net, layers, corners)).max() <= 1e-4


@pytest.mark.parametrize("step", [2, 4])
@pytest.mark.parametrize("size", [(101, 101), (102, 105), (103, 106), (104, 112), (121, 104)])
def test_dense_answers_at_every_few_pixels(size: tuple[int, int], step: Literal[2, 4]) -> None:
    net, layers = random_net(), random_layers(*size)
    around = np.pad(layers, ((0, 0), (0, step), (0, step)), mode="wrap")
    with torch.inference_mode():
        few, every = net.dense(tensor(layers), step).numpy(), net.dense(tensor(around)).numpy()[::step, ::step]
    assert few.shape == tuple(-(-(length - 101) // step) + 1 for length in size)
    assert np.abs(few - every[: few.shape[0], : few.shape[1]]).max() <= 1e-4


def test_dense_at_every_16th_pixel_is_the_pooled_network() -> None:
    net, layers = random_net(), random_layers(101 + 33, 101 + 18)
    with torch.inference_mode():
        dense, pooled = net.dense(tensor(layers)), net(tensor(layers[:, : 101 + 32, : 101 + 16]))
    assert (dense[::16, ::16] - (pooled[0, 1] - pooled[0, 0])).abs().max() <= 1e-4


def test_the_last_seven_rows_and_columns_of_a_patch_do_not_matter() -> None:
    net, layers = random_net(), random_layers(101, 101)
    with torch.inference_mode():
        before = net(tensor(layers))
        layers[:, -7:], layers[:, :, -7:] = 100, 100
        unmoved = net(tensor(layers))
        layers[:, -8, 50] += 100
        moved = net(tensor(layers))
    assert torch.equal(before, unmoved)
    assert not torch.equal(before, moved), "the eighth last row does"


def test_both_layers_matter_and_are_not_exchangeable() -> None:
    net, patch = random_net(), torch.from_numpy(random_layers(101, 101)).unsqueeze(0)
    assert (net(patch) - net(patch.flip(1))).abs().max() > 0.01


def test_fragments_by_hand() -> None:
    maps = torch.arange(25.0).reshape(1, 1, 5, 5)
    made = fragments(maps)
    assert made.shape == (4, 1, 2, 2)
    assert made[:, 0].tolist() == [
        [[6, 8], [16, 18]],  # offset (0, 0)
        [[7, 9], [17, 19]],  # (0, 1)
        [[11, 13], [21, 23]],  # (1, 0)
        [[12, 14], [22, 24]],  # (1, 1)
    ]


def test_fragments_of_an_even_size_repeat_the_last_row_and_column() -> None:
    made = fragments(torch.arange(8.0).reshape(1, 1, 2, 4))
    assert made[:, 0].tolist() == [[[5, 7]], [[6, 7]], [[5, 7]], [[6, 7]]]


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
@pytest.mark.parametrize("size", [(7, 9), (8, 9), (7, 10), (8, 6)])
def test_fragments_are_pooled_and_cut_at_0_as_torch_does_it(size: tuple[int, int], dtype: torch.dtype) -> None:
    maps = torch.randn(2, 3, *size, generator=torch.Generator().manual_seed(0)).to(dtype)
    height, width = size
    for index, made in enumerate(fragments(maps).split(2)):
        shifted = maps[:, :, index // 2 :, index % 2 :]
        expected = torch.max_pool2d(shifted, 2, ceil_mode=True)[:, :, : height // 2, : width // 2].relu()
        assert torch.equal(made, expected)


def test_fragments_keep_the_batch_together() -> None:
    maps = torch.stack([torch.zeros(1, 3, 3), torch.ones(1, 3, 3)])
    assert fragments(maps).flatten().tolist() == [0, 1] * 4


def test_interleave_by_hand() -> None:
    """Each of the 16 x 16 pixels of a cell is told which fragment it came from."""
    made = interleave(torch.arange(256.0).reshape(256, 1, 1))
    assert made.shape == (16, 16)
    assert made[0, :5].tolist() == [0, 1, 4, 5, 16], "x offsets 1, 2, 1 + 2, 4: bits 0, 2, 4"
    assert made[:5, 0].tolist() == [0, 2, 8, 10, 32], "y offsets: bits 1, 3, 5"
    assert made[8, 8] == 128 + 64 and made[15, 15] == 255
    assert sorted(made.flatten().tolist()) == list(range(256))


def test_interleave_puts_the_cells_16_px_apart() -> None:
    values = torch.zeros(256, 2, 3)
    values[0, 1, 2] = 1
    assert interleave(values).nonzero().tolist() == [[16, 32]]
