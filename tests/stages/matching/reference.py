"""The paper's matching-Net written down literally, layer by layer, and small nets and pairs to try it on."""

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from semidense.stages.learning.parameters import initialise
from semidense.stages.matching.declaration import RADIUS, Head
from semidense.stages.matching.net import MatchingNet

NETS = [(channels, head) for head in ("compact", "paper") for channels in (1, 2, 3)]
"""Channels a view and head of every network."""


def random_net(channels: int = 3, head: Head = "compact", seed: int = 0) -> MatchingNet:
    """Return a network with nothing at zero: random weights, biases and channel scales, outputs of size one."""
    net = MatchingNet(channels, head)
    initialise(net, seed)
    generator = torch.Generator().manual_seed(seed + 1)
    with torch.no_grad():
        for name, parameter in net.named_parameters():
            if name.endswith("bias"):
                parameter.normal_(0, 0.2, generator=generator)
        net.out.weight.mul_(10)
        net.input_mean.normal_(0, 0.3, generator=generator)
        net.input_std.uniform_(0.5, 2, generator=generator)
    return net


@torch.inference_mode()
def literal_logits(net: MatchingNet, left: Tensor, right: Tensor) -> Tensor:
    """Return the logits (N, 2) of patches (N, l, 11, 11): Table 1 as three-dimensional convolutions.

    The 2l layers alternate: layer 1 of the left, layer 1 of the right, layer 2 of the left, ...
    """
    scale = [(view - net.input_mean[:, None, None]) / net.input_std[:, None, None] for view in (left, right)]
    layers = torch.stack(scale, 2).flatten(1, 2)  # N 2l 11 11
    maps = functional.relu(functional.conv3d(layers[:, None], net.conv1.weight[:, :, None], net.conv1.bias))
    assert maps.shape[1:] == (32, 2 * net.channels, 9, 9)
    both = torch.stack([net.conv2_left.weight, net.conv2_right.weight], 2)  # 128 32 2 3 3
    maps = functional.relu(functional.conv3d(maps, both, net.conv2_left.bias, stride=(2, 1, 1)))
    assert maps.shape[1:] == (128, net.channels, 7, 7)
    across = net.conv3.weight.reshape(64, net.channels, 128, 3, 3).transpose(1, 2)  # 64 128 l 3 3
    features = functional.relu(functional.conv3d(maps, across, net.conv3.bias)).flatten(1)
    assert features.shape[1:] == (1600,)
    for layer in net.hidden:
        features = functional.relu(functional.linear(features, layer.weight.flatten(1), layer.bias))
    return functional.linear(features, net.out.weight.flatten(1), net.out.bias)


def patches(view: np.ndarray) -> Tensor:
    """Return the patch around each pixel of (channel, y, x), the edge repeated: (y, x, channel, 11, 11)."""
    padded = np.pad(view, ((0, 0), (RADIUS, RADIUS), (RADIUS, RADIUS)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (11, 11), (1, 2))
    return torch.from_numpy(windows.transpose(1, 2, 0, 3, 4).copy())


def literal_volume(net: MatchingNet, channels: np.ndarray, disparities: range) -> np.ndarray:
    """Return the costs (y, x, d) patch by patch, NaN where the right patch's centre is outside the image."""
    left, right = patches(channels[0]), patches(channels[1])
    height, width = channels.shape[2:]
    cells = [
        (y, x, index)
        for index, d in enumerate(disparities)
        for y in range(height)
        for x in range(width)
        if 0 <= x - d < width
    ]
    pairs = [(left[y, x], right[y, x - disparities[index]]) for y, x, index in cells]
    logits = literal_logits(net, *(torch.stack(side) for side in zip(*pairs, strict=True))).numpy()
    volume = np.full((height, width, len(disparities)), np.nan, np.float32)
    volume[tuple(np.transpose(cells))] = logits[:, 1] - logits[:, 0]
    return volume


def shifted_scene(seed: int = 0, height: int = 30, width: int = 64, low: int = 2, high: int = 9) -> dict[str, dict]:
    """Return channels and truth of a random texture: its upper half at disparity ``low``, its lower half at ``high``.

    Every row has one disparity, so which pixels both views see follows from the image's width alone.
    """
    rng = np.random.default_rng(seed)
    disparity = np.repeat(np.int64([low, high]), [height // 2, height - height // 2])[:, None]
    margin = max(abs(low), abs(high))
    texture = rng.normal(size=(3, height, width + 2 * margin)).astype(np.float32)
    columns = np.arange(width)
    left = np.stack([np.take_along_axis(plane, margin + columns[None], 1) for plane in texture])
    right = np.stack([np.take_along_axis(plane, margin + columns[None] + disparity, 1) for plane in texture])
    truth = np.broadcast_to(disparity, (height, width)).astype(np.float32)
    return {
        "channels": {"channels": np.stack([left, right])},
        "truth": {
            "disparity": truth,
            "nonocc": (columns - disparity >= 0) & (columns - disparity < width),
            "right_disparity": truth.copy(),
            "right_nonocc": (columns + disparity >= 0) & (columns + disparity < width),
            "range": np.array([low - 4, high + 4], np.int32),
        },
    }
