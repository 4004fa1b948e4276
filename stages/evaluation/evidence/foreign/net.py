"""The net that scores a pixel of a map that another matcher made."""

import torch
from torch import Tensor, nn

from semidense.stages.evaluation.evidence.foreign.declaration import FEATURES
from semidense.stages.evaluation.evidence.standard import Standardised

HIDDEN = 32


class ForeignNet(Standardised):
    """From what is known of a pixel to the log-odds that its disparity is right: two hidden layers of 32 units."""

    def __init__(self) -> None:
        super().__init__(len(FEATURES))
        self.first = nn.Linear(len(FEATURES), HIDDEN)
        self.second = nn.Linear(HIDDEN, HIDDEN)
        self.out = nn.Linear(HIDDEN, 1)

    def forward(self, features: Tensor) -> Tensor:
        """Return log-odds (pixel,) of features (pixel, feature)."""
        hidden = torch.relu(self.first(self.standardised(features)))
        odds: Tensor = self.out(torch.relu(self.second(hidden))).squeeze(1)
        return odds
