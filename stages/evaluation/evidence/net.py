"""The net that weighs the evidence of each pixel, and that around it."""

import torch
from torch import Tensor, nn
from torch.nn import functional

from semidense.stages.evaluation.evidence.declaration import DILATIONS, REACH

HIDDEN = 32
FARTHEST = 4.0
"""Deviations from the mean beyond which an input counts the same: what no training scene has, must not decide."""
CONSTANT, UNSEEN = 1e-3, 1e9
"""A number whose deviation in training is below the first tells nothing: its scale is the second, so that it never
counts. With its own scale it would outweigh all others in a map where it does vary."""


class EvidenceNet(nn.Module):
    """From what is known of the pixels to the log-odds that their disparities are right.

    One branch sees a pixel alone. The other one sees the map at half the size and looks at its surroundings with three
    3 x 3 kernels of growing dilation; each adds to what was there. Both are joined and give one number a pixel. The
    mean and the deviation of its inputs in training are kept with the weights.

    Args:
        inputs: numbers that are known of a pixel.
    """

    centre: Tensor
    scale: Tensor

    def __init__(self, inputs: int) -> None:
        super().__init__()
        self.register_buffer("centre", torch.zeros(inputs))
        self.register_buffer("scale", torch.ones(inputs))
        self.first = nn.Conv2d(inputs, HIDDEN, 1)
        self.around = nn.ModuleList(
            nn.Conv2d(HIDDEN, HIDDEN, 3, dilation=apart, padding=(0, apart)) for apart in DILATIONS
        )
        self.of_pixel = nn.Conv2d(HIDDEN, HIDDEN, 1)
        self.of_around = nn.Conv2d(HIDDEN, HIDDEN, 1, bias=False)
        self.out = nn.Conv2d(HIDDEN, 1, 1)

    def keep(self, mean: Tensor, deviation: Tensor) -> None:
        """Keep the mean and the deviation of each input in training."""
        self.centre.copy_(mean)
        self.scale.copy_(deviation.where(deviation > CONSTANT, torch.tensor(UNSEEN)))

    def forward(self, features: Tensor) -> Tensor:
        """Return log-odds (map, y, x) of features (map, feature, y + 2 REACH, x).

        The rows above and below are real ones or those that continue the map. Beside the map there is nothing: zeros.
        Rows are taken in pairs, so a tile begins at an even row.
        """
        height, width = features.shape[2] - 2 * REACH, features.shape[3]
        standardised = (features - self.centre.view(-1, 1, 1)) / self.scale.view(-1, 1, 1)
        alone = torch.relu(self.first(standardised.clamp(-FARTHEST, FARTHEST)))
        wide = functional.avg_pool2d(alone, 2, ceil_mode=True)
        for kernel, apart in zip(self.around, DILATIONS, strict=True):
            wide = wide[:, :, apart:-apart] + torch.relu(kernel(wide))
        wide = functional.interpolate(self.of_around(wide), scale_factor=2.0, mode="bilinear", align_corners=False)
        first = REACH - 2 * sum(DILATIONS)  # the row of the wide branch that is the first of the result
        of_pixel = self.of_pixel(alone[:, :, REACH : REACH + height])
        odds: Tensor = self.out(torch.relu(of_pixel + wide[:, :, first : first + height, :width]))[:, 0]
        return odds
