"""The paper's evaluation-Net written down literally for one patch, a net and small scenes to try it on."""

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from semidense.stages.evaluation.net import EvaluationNet
from semidense.stages.learning.parameters import initialise


def random_net(seed: int = 0) -> EvaluationNet:
    """Return a network with nothing at zero: random weights and biases, outputs of size one."""
    net = EvaluationNet()
    initialise(net, seed)
    generator = torch.Generator().manual_seed(seed + 1)
    with torch.no_grad():
        for name, parameter in net.named_parameters():
            if name.endswith("bias"):
                parameter.normal_(0, 0.2, generator=generator)
        net.out.weight.mul_(10)
    return net


@torch.inference_mode()
def literal_logits(net: EvaluationNet, patches: Tensor) -> Tensor:
    """Return the logits (N, 2) of patches (N, 2, 101, 101): Table 1 as three-dimensional convolutions."""
    maps = patches[:, None]  # N 1 layer y x
    for conv, size in ((net.conv1, 49), (net.conv2, 23), (net.conv3, 10)):
        maps = functional.relu(functional.conv3d(maps, conv.weight[:, :, None], conv.bias))
        maps = functional.max_pool3d(maps, (1, 2, 2))
        assert maps.shape[2:] == (2, size, size)
    both = torch.stack([net.conv4_gray.weight, net.conv4_disparity.weight], 2)  # 128 64 2 3 3
    maps = functional.relu(functional.conv3d(maps, both, net.conv4_gray.bias))
    features = functional.max_pool3d(maps, (1, 2, 2)).flatten(1)
    assert features.shape[1:] == (2048,)
    hidden = functional.relu(functional.linear(features, net.fc.weight.flatten(1), net.fc.bias))
    return functional.linear(hidden, net.out.weight.flatten(1), net.out.bias)


def literal_log_odds(net: EvaluationNet, layers: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the log-odds of the patches of (layer, y, x) whose top left corners (y, x) are given."""
    patches = np.stack([layers[:, y : y + 101, x : x + 101] for y, x in corners])
    logits = literal_logits(net, torch.from_numpy(patches)).numpy()
    difference: np.ndarray = logits[:, 1] - logits[:, 0]
    return difference


def random_layers(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(2, height, width)).astype(np.float32)


def scene(seed: int = 0, height: int = 40, width: int = 56) -> dict[str, dict[str, np.ndarray]]:
    """Return a scene whose disparities are right on the left half and wrong by 3 px, and rough, on the right.

    The right view's are wrong by 5 px in the last eight rows; its truth is not known in the first six.
    """
    rng = np.random.default_rng(seed)
    truth = np.full((height, width), 3, np.float32)
    disparity = truth + rng.uniform(-0.5, 0.5, truth.shape).astype(np.float32)
    disparity[:, width // 2 :] += 3 * rng.choice(np.float32([-1, 1]), (height, width - width // 2))
    truth[:2], disparity[3, 3] = np.nan, np.nan
    left, right = (rng.integers(0, 256, (height, width, 1)).astype(np.uint8) for _ in range(2))
    right_truth = np.full((height, width), 4, np.float32)
    right_disparity = right_truth + rng.uniform(-0.5, 0.5, truth.shape).astype(np.float32)
    right_disparity[-8:] += 5
    right_truth[:6] = np.nan
    return {
        "images": {"left": left, "right": right, "moments": np.array([[127.0, 74.0], [125.0, 70.0]])},
        "disparity": {"disparity": disparity},
        "right_disparity": {"disparity": right_disparity},
        "truth": {"disparity": truth, "right_disparity": right_truth},
    }
