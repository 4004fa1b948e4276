"""What a net that weighs the evidence learns by: the cross-entropy of the judged pixels of a crop."""

import torch
from torch import Tensor
from torch.nn import functional

from semidense.stages.evaluation.evidence.declaration import EvidenceSamples
from semidense.stages.evaluation.evidence.net import EvidenceNet
from semidense.stages.evaluation.samples import UNKNOWN

LEAST = 500
"""Pixels that a crop counts as at least: a few judged ones do not weigh as much as a whole crop."""


def crop_loss(net: EvidenceNet, crop: EvidenceSamples) -> Tensor:
    """Return the cross-entropy of a crop, a number a pixel.

    Args:
        net: what learns.
        crop: ``features`` (feature, y + 2 REACH, x) float32 and ``right`` (y, x) int8.
    """
    labels = torch.from_numpy(crop["right"])
    judged = labels != UNKNOWN
    odds = net(torch.from_numpy(crop["features"])[None])[0][judged]
    total = functional.binary_cross_entropy_with_logits(odds, (labels[judged] == 1).float(), reduction="sum")
    return total / max(len(odds), LEAST)
