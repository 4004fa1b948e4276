"""The net that weighs the evidence of each pixel, and that around it."""

import torch
from torch import Tensor, nn
from torch.nn import functional

from semidense.stages.evaluation.evidence.declaration import DILATIONS, REACH
from semidense.stages.evaluation.evidence.standard import Standardised

HIDDEN = 32
FARTHEST = 4.0
"""Deviations from the mean beyond which an input counts the same: what no training scene has, must not decide."""


class EvidenceNet(Standardised):
    """From what is known of the pixels to the log-odds that their disparities are right.

    One branch sees a pixel alone. The other one sees the map at half the size and looks at its surroundings with three
    3 x 3 kernels of growing dilation; each adds to what was there. Both are joined and give one number a pixel.

    Args:
        inputs: numbers that are known of a pixel.
    """

    def __init__(self, inputs: int) -> None:
        super().__init__(inputs)
        self.first = nn.Conv2d(inputs, HIDDEN, 1)
        self.around = nn.ModuleList(
            nn.Conv2d(HIDDEN, HIDDEN, 3, dilation=apart, padding=(0, apart)) for apart in DILATIONS
        )
        self.of_pixel = nn.Conv2d(HIDDEN, HIDDEN, 1)
        self.of_around = nn.Conv2d(HIDDEN, HIDDEN, 1, bias=False)
        self.out = nn.Conv2d(HIDDEN, 1, 1)

    def forward(self, features: Tensor) -> Tensor:
        """Return log-odds (map, y, x) of features (map, feature, y + 2 REACH, x).

        The rows above and below are real ones or those that continue the map. Beside the map there is nothing: zeros.
        Rows are taken in pairs, so a tile begins at an even row.
        """
        height, width = features.shape[2] - 2 * REACH, features.shape[3]
        alone = torch.relu(self.first(self.standardised(features).clamp(-FARTHEST, FARTHEST)))
        wide = functional.avg_pool2d(alone, 2, ceil_mode=True)
        for kernel, apart in zip(self.around, DILATIONS, strict=True):
            wide = wide[:, :, apart:-apart] + torch.relu(kernel(wide))
        wide = functional.interpolate(self.of_around(wide), scale_factor=2.0, mode="bilinear", align_corners=False)
        first = REACH - 2 * sum(DILATIONS)  # the row of the wide branch that is the first of the result
        of_pixel = self.of_pixel(alone[:, :, REACH : REACH + height])
        odds: Tensor = self.out(torch.relu(of_pixel + wide[:, :, first : first + height, :width]))[:, 0]
        return odds
