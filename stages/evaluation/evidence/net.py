"""The net that weighs the evidence of one pixel."""

import torch
from torch import Tensor, nn

from semidense.stages.disparity.evidence import FEATURES
from semidense.stages.evaluation.evidence.declaration import OF_MAP, OF_NEIGHBOURS

INPUTS = len(OF_MAP) + len(FEATURES) + len(OF_NEIGHBOURS)
"""What a map by our own summed costs looks like, what the costs say of the pixel, and what they say around it."""
HIDDEN = 32
CONSTANT, UNSEEN = 1e-3, 1e9
"""A number whose deviation in training is below the first tells nothing: its scale is the second, so that it never
counts. With its own scale it would outweigh all others in a map where it does vary."""


class EvidenceNet(nn.Module):
    """From what is known of a pixel to the log-odds that its disparity is right: two hidden layers of 32 units.

    Args:
        inputs: numbers that are known of a pixel; by default those of a map by our own summed costs.
    """

    centre: Tensor
    scale: Tensor

    def __init__(self, inputs: int = INPUTS) -> None:
        super().__init__()
        # The inputs' mean and deviation in training, kept with the weights.
        self.register_buffer("centre", torch.zeros(inputs))
        self.register_buffer("scale", torch.ones(inputs))
        self.first = nn.Linear(inputs, HIDDEN)
        self.second = nn.Linear(HIDDEN, HIDDEN)
        self.out = nn.Linear(HIDDEN, 1)

    def measure(self, features: Tensor) -> None:
        """Take the mean and the deviation of the inputs from the training's features (pixel, feature)."""
        self.centre.copy_(features.mean(dim=0))
        deviation = features.std(dim=0, correction=0)
        self.scale.copy_(deviation.where(deviation > CONSTANT, torch.tensor(UNSEEN)))

    def forward(self, features: Tensor) -> Tensor:
        """Return log-odds (pixel,) of features (pixel, feature)."""
        hidden = torch.relu(self.first((features - self.centre) / self.scale))
        odds: Tensor = self.out(torch.relu(self.second(hidden))).squeeze(1)
        return odds
