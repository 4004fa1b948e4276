"""matching-Net: the network that says how well two patches match (the paper's Table 1, left).

Input of one sample: an 11 x 11 patch of the left and of the right view in ``l`` channels each.

    layer   kernel, filters        output           what it does
    conv1   3x3x1, 32              9 x 9 x 2l       one image filter bank, the same on every layer
    conv2   3x3x2, 128, stride 2   7 x 7 x l        joins layer k of the left with layer k of the right
    conv3   3x3xl, 64              5 x 5 x 1        joins the channels
    fc...                          128              ``compact``: 1600 -> 128; ``paper``: 1600 -> 1600 -> 128
    out                            2                output 0: match, output 1: mismatch

The same class trains and infers, on patches and on whole images, because of three identities:

1. The network is convolutional and never pads, so a larger input gives the answers of all its patches.
2. ``conv2`` has one kernel slice for the left and one for the right layer and is linear before its
   ReLU: ``W * [L, R] = W_l * L + W_r * R``. ``embed`` computes each product once an image; a
   disparity then costs one shifted addition, and what follows in ``join``.
3. A fully connected layer on a 5 x 5 map is a 5 x 5 convolution.
"""

from functools import lru_cache, partial
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from semidense.stages.compute.precision import autocast
from semidense.stages.learning.parameters import count, from_vector, unset
from semidense.stages.matching.declaration import Head
from semidense.stages.stage import StageError

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
HEADS: tuple[Head, ...] = ("compact", "paper")


class MatchingNet(nn.Module):
    """The paper's matching-Net for ``channels`` channels a view.

    Args:
        channels: channels a view (``l``); 3 for gray, rank and companion.
        head: ``compact`` (1600 -> 128 -> 2) or ``paper`` (1600 -> 1600 -> 128 -> 2).
    """

    input_mean: Tensor
    input_std: Tensor

    def __init__(self, channels: int = 3, head: Head = "compact") -> None:
        super().__init__()
        if channels < 1:
            raise StageError(f"matching-Net needs at least one channel, got {channels}")
        self.channels, self.head = channels, head
        # The channels' scales differ by an order of magnitude and conv1 is shared between them, so the
        # net itself brings them to one scale: fixed numbers of the training set, never of the image at hand.
        self.register_buffer("input_mean", torch.zeros(channels))
        self.register_buffer("input_std", torch.ones(channels))
        self.conv1 = nn.Conv2d(1, 32, 3)
        self.conv2_left = nn.Conv2d(32, 128, 3)
        self.conv2_right = nn.Conv2d(32, 128, 3, bias=False)
        self.conv3 = nn.Conv2d(128 * channels, 64, 3)
        self.hidden = nn.ModuleList(_hidden_layers(head))
        self.out = nn.Conv2d(128, 2, 1)

    def embed(self, view: Tensor, side: Side) -> Tensor:
        """Return one view's share of conv2, before the ReLU.

        Args:
            view: (B, channels, H, W).
            side: which of conv2's two kernel slices to apply.

        Returns:
            (B, channels * 128, H - 4, W - 4); the 128 filters of channel k are contiguous.
        """
        batch, _, height, width = view.shape
        return self.embed_layers(view, side).reshape(batch, self.channels * 128, height - 4, width - 4)

    def embed_layers(self, view: Tensor, side: Side) -> Tensor:
        """As ``embed``, with each channel on its own: (B * channels, 128, H - 4, W - 4)."""
        batch, _, height, width = view.shape
        conv2 = self.conv2_left if side == "left" else self.conv2_right
        scaled = (view - self.input_mean[:, None, None]) / self.input_std[:, None, None]
        layers = scaled.to(self.conv1.weight.dtype).reshape(batch * self.channels, 1, height, width)
        maps: Tensor = conv2(functional.relu(self.conv1(layers)))
        return maps

    def describe(self, joined: Tensor) -> Tensor:
        """Return the 128 features before the output layer.

        Args:
            joined: (B, channels * 128, H, W), conv2's output: ``relu(embed(left) + embed(right))``.

        Returns:
            (B, 128, H - 6, W - 6), not negative.
        """
        features: Tensor = functional.relu(self.conv3(joined))
        for layer in self.hidden:
            features = functional.relu(layer(features))
        return features

    def join(self, left: Tensor, right: Tensor) -> Tensor:
        """Return the logits (B, 2, H - 6, W - 6) of two embedded views of the same size."""
        logits: Tensor = self.out(self.describe(functional.relu(left + right)))
        return logits

    def forward(self, left: Tensor, right: Tensor) -> Tensor:
        """Return the logits of two views: (B, channels, H, W) twice -> (B, 2, H - 10, W - 10)."""
        return self.join(self.embed(left, "left"), self.embed(right, "right"))

    def log_odds(self, joined: Tensor) -> Tensor:
        """Return the log-odds of a mismatch, output 1 minus output 0: (B, H - 6, W - 6) float32.

        The difference of the two outputs is one filter. It is applied in float32 whatever the
        precision of the rest: bfloat16's 8 bits would make ties of neighbouring costs.
        """
        features = self.describe(joined)
        with autocast("float32"):  # or autocast would bring the product back to bfloat16
            return self.odds_of_features(features.float().permute(0, 2, 3, 1))

    def logits_of_features(self, features: Tensor) -> Tensor:
        """Return the logits from the features before the output layer: (B, H, W, 128) -> (B, 2, H, W)."""
        logits: Tensor = functional.linear(features, self.out.weight[:, :, 0, 0], self.out.bias)
        return logits.permute(0, 3, 1, 2)

    def odds_of_features(self, features: Tensor) -> Tensor:
        """Return the log-odds of a mismatch from the features before the output layer: (..., 128) -> (...)."""
        weight = (self.out.weight[1] - self.out.weight[0]).float().reshape(128)
        return features @ weight + self._output_bias()

    def _output_bias(self) -> Tensor:
        if self.out.bias is None:
            raise StageError("matching-Net's output layer has lost its bias")
        return (self.out.bias[1] - self.out.bias[0]).float()


def require_views(net: MatchingNet, views: NDArray[np.float32]) -> None:
    """Refuse views (view, channel, y, x) that do not fit the network.

    Raises:
        StageError: naming what was expected.
    """
    if views.shape[:2] != (2, net.channels):
        raise StageError(f"matching-Net expects 2 views of {net.channels} channels, got {views.shape[:2]}")


def net_from_parameters(parameters: NDArray[np.float32], channels: int) -> MatchingNet:
    """Return the network that a vector of parameters belongs to, ready for inference.

    The head follows from the number of parameters. It is built once for all tiles of a volume, so nobody may change it.

    Args:
        parameters: float32 (parameter,), as ``to_vector`` makes them.
        channels: channels a view of the images at hand.

    Raises:
        StageError: if no head fits: the network was trained on other channels.
    """
    return _built(np.ascontiguousarray(parameters, np.float32).tobytes(), channels)


@lru_cache(maxsize=2)
def _built(parameters: bytes, channels: int) -> MatchingNet:
    vector = np.frombuffer(parameters, np.float32)
    for head in HEADS:
        net = unset(partial(MatchingNet, channels, head))
        if count(net) == vector.size:
            from_vector(net, vector)
            return net.to(memory_format=torch.channels_last)  # type: ignore[call-overload, no-any-return]
    raise StageError(
        f"the matching-Net's {vector.size} parameters do not fit {channels} channel(s) a view: "
        "it was trained on other channels; train one for these, or go back to the channels it knows"
    )


def _hidden_layers(head: Head) -> list[nn.Conv2d]:
    """Return the fully connected layers between conv3 and the output, as convolutions."""
    if head == "compact":
        return [nn.Conv2d(64, 128, 5)]
    if head == "paper":
        return [nn.Conv2d(64, 1600, 5), nn.Conv2d(1600, 128, 1)]
    raise StageError(f"matching-Net has no head {head!r}: use 'compact' or 'paper'")
