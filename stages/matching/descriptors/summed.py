"""Learning from the map by summed costs: crops wide enough for paths, and the loss of their sums.

A volume of a preset is seldom read alone: its costs are summed along paths first. So a network that learnt from single
cells learns on from the sums. Where texture is thin its costs become flat and leave the decision to the neighbours.
"""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from semidense.stages.compute.precision import Precision, autocast
from semidense.stages.disparity.aggregation.differentiable import path_sums
from semidense.stages.learning.augmentation import relight
from semidense.stages.learning.scenes import Scenes
from semidense.stages.matching.crops import Channels, cut, to_tensor
from semidense.stages.matching.declaration import REACH, MatchingSamples
from semidense.stages.matching.descriptors.declaration import DescriptorNetParams, OfSummed
from semidense.stages.matching.descriptors.net import DescriptorNet
from semidense.stages.matching.descriptors.transformed_training import describer
from semidense.stages.matching.descriptors.volume import diagonals
from semidense.stages.matching.samples import visible_truth
from semidense.stages.stage import StageError
from semidense.stages.transforms.gray import to_gray

CAP = 40.0
"""Largest cost above the pixel's least, log-odds, as when costs are summed for a map."""
PENALTIES = np.empty((2, 256, 2), np.float32)
PENALTIES[:, :7], PENALTIES[:, 7:] = (24, 192), (3, 24)
"""Penalties P1 and P2 of all paths by the difference of gray, log-odds: an eighth where it is above 6 levels. They are
smaller than those of a map, and leave more to the costs."""
TEMPERATURE = 24.0
"""Cost, summed over the paths, that makes a disparity e times less likely."""
WINDOWS = ((1.0, 1.0), (3.0, 0.5))
"""Errors of a disparity that is still right, px, and what being right so weighs."""
FLOOR = 0.01
"""Least probability of the right disparities: pixels that are lost do not decide the step."""


@dataclass(frozen=True)
class WideScene:
    """What is needed of one training scene beside its channels, upright or mirrored.

    Attributes:
        gray: (y, x) uint8 of the left view.
        truth: (y, x) px, NaN where it is unknown or not both views see the pixel.
        disparities: the scene's range.
    """

    gray: NDArray[np.uint8]
    truth: NDArray[np.float32]
    disparities: range

    @property
    def nbytes(self) -> int:
        """What keeping it takes."""
        return self.gray.nbytes + self.truth.nbytes


@dataclass(frozen=True)
class WideCrop:
    """One crop: both views with their margins, edges and truth, and which cells have a right pixel.

    Attributes:
        left: (1, channel, y + 16, x + 16).
        strip: (1, channel, y + 16, x + 16 + d - 1): all that the crop may meet in the right view.
        gray: (y, x) uint8.
        truth: (y, x) index of the true disparity, NaN unknown.
        outside: (x, d): True where the right pixel is outside the image.
    """

    left: Tensor
    strip: Tensor
    gray: NDArray[np.uint8]
    truth: Tensor
    outside: Tensor


def wide_scenes(inputs: OfSummed) -> Scenes[WideScene]:
    """Return the training scenes, each upright (number 2 n) and mirrored (number 2 n + 1).

    Raises:
        StageError: if there are no images or truths.
    """
    if "images" not in inputs or "truth" not in inputs:
        raise StageError("learning from summed costs needs the images and the truth of every training scene")
    images, truths = inputs["images"], inputs["truth"]

    def scene(number: int) -> WideScene:
        place, mirrored = divmod(number, 2)
        low, high = (int(end) for end in truths[place]["range"])
        gray = to_gray(images[place]["right" if mirrored else "left"])
        gray = np.ascontiguousarray(gray[:, ::-1]) if mirrored else gray
        return WideScene(gray, visible_truth(truths[place], bool(mirrored)), range(low, high + 1))

    return Scenes(scene, 2 * len(truths))


def cut_wide_crop(
    params: DescriptorNetParams,
    samples: MatchingSamples,
    channels: Channels,
    scenes: Scenes[WideScene],
    rng: np.random.Generator,
) -> WideCrop:
    """Cut a crop around a random sample, with another light on each view.

    Args:
        params: size of the crop and strength of the lighting.
        samples: arrays as ``draw_samples`` makes them; they say how often each scene comes.
        channels: float32 (view, channel, y, x) of each training scene.
        scenes: as ``wide_scenes`` returns them.
        rng: source of the choice and the lighting.
    """
    index = int(rng.integers(len(samples["scene"])))
    place, mirrored = int(samples["scene"][index]), bool(samples["mirrored"][index])
    scene = scenes[2 * place + mirrored]
    views = channels[place][::-1, :, :, ::-1] if mirrored else channels[place]
    height, width = scene.truth.shape
    size = min(params.summed_height, height), min(params.summed_width, width)
    middle = (int(samples["y"][index]), int(samples["x"][index]))
    y, x = np.clip(np.array(middle) - rng.integers(0, size), 0, np.array([height, width]) - size).tolist()
    rows, columns = np.arange(y - REACH, y + size[0] + REACH), np.arange(x - REACH, x + size[1] + REACH)
    reach = np.arange(columns[0] - scene.disparities[-1], columns[-1] - scene.disparities[0] + 1)
    left, strip = (
        to_tensor(relight(cut(view, rows, across), params.relight, rng))
        for view, across in zip(views, (columns, reach), strict=True)
    )
    inside = np.s_[y : y + size[0], x : x + size[1]]
    matched = np.arange(x, x + size[1])[:, None] - np.array(scene.disparities)
    return WideCrop(
        left,
        strip,
        scene.gray[inside],
        torch.from_numpy(scene.truth[inside] - scene.disparities[0]),
        torch.from_numpy((matched < 0) | (matched >= width)),
    )


def summed_loss(net: DescriptorNet, crop: WideCrop, precision: Precision = "float32") -> Tensor:
    """Return how improbable the right disparities of a crop are by its summed costs; 0 if no truth is known.

    Of each pixel with a truth, ``-log`` of the probability that a softmax of the sums gives to the disparities within
    each of ``WINDOWS``, weighed; the mean over these pixels. At the very edge of a window a disparity counts half.
    """
    known = torch.isfinite(crop.truth) & ~crop.outside.all(1)
    sums = path_sums(crop_costs(net, crop, precision), crop.gray, PENALTIES)
    probability = functional.softmax(-sums.masked_fill(crop.outside, torch.inf)[known] / TEMPERATURE, dim=1)
    distance = (torch.arange(sums.shape[2]) - crop.truth[known][:, None]).abs()
    losses = [
        -weight * (FLOOR + (1 - FLOOR) * (probability * (window + 0.5 - distance).clamp(0, 1)).sum(1)).log()
        for window, weight in WINDOWS
    ]
    return sum(losses, torch.zeros(int(known.sum()))).sum() / max(int(known.sum()), 1)


def crop_costs(net: DescriptorNet, crop: WideCrop, precision: Precision) -> Tensor:
    """Return the costs of a crop as they are summed: (y, x, d) log-odds above the pixel's least, at most ``CAP``.

    A cell whose right pixel is outside the image has the mean of the pixel's others.
    """
    describe = describer(net, precision)
    with autocast(precision):
        left, strip = describe(crop.left), describe(crop.strip)
    costs = net.log_odds(diagonals(left @ strip.mT, crop.outside.shape[1])).flip(2)
    inside = (~crop.outside).float()
    mean = (costs * inside).sum(2, keepdim=True) / inside.sum(1).clamp(min=1)[:, None]
    filled = torch.where(crop.outside, mean, costs)  # the mean is never the least; without any cell all are 0
    return (filled - filled.amin(2, keepdim=True)).clamp(max=CAP)
