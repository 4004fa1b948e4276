"""The reliability diagram: is a pixel with a confidence of 0.8 right in 8 of 10 cases?"""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from semidense.pipeline.figures.colours import BLUE, QUIET, SKY
from semidense.pipeline.figures.drawing import new_figure
from semidense.stages.metrics.errors import MASKS, THRESHOLDS
from semidense.stages.metrics.tally import Tally

_BINS = 10
_ROUNDING = 1e-9
"""What a threshold such as 0.3 may lie below its tenth when it is multiplied."""
_FEWEST = 50
"""Least number of pixels in a bin that is drawn: the share of fewer says little."""


class Reliability(NamedTuple):
    """How often pixels are right, in ten bins of confidence: 0 to 0.1, 0.1 to 0.2 and so on.

    Attributes:
        confidence: (bin,) mean confidence; NaN where there is no pixel.
        right: (bin,) share of right pixels, 0-1; NaN where there is no pixel.
        pixels: (bin,) their number.
    """

    confidence: NDArray[np.float64]
    right: NDArray[np.float64]
    pixels: NDArray[np.float64]

    @property
    def error(self) -> float:
        """The expected calibration error: |share - confidence| of a pixel's bin, mean over pixels; NaN without any."""
        known = self.pixels > 0
        if not known.any():
            return float("nan")
        return float(np.average(np.abs(self.right - self.confidence)[known], weights=self.pixels[known]))


def reliability(tallies: list[Tally], mask: str = "all", threshold: float = 1.0) -> Reliability:
    """Return how often pixels are right, by confidence, over all pixels of several scenes.

    Args:
        tallies: one a scene, with thresholds at every tenth.
        mask: ``all`` is what the evaluation-Net learns: hidden pixels count too.
        threshold: px, error up to which a pixel is right.
    """
    m, t = MASKS.index(mask), THRESHOLDS.index(threshold)
    pixels = _tenths(tallies, [each.reported[m] for each in tallies])
    wrong = _tenths(tallies, [each.wrong[m, t] for each in tallies])
    confidence = _tenths(tallies, [each.confidence[m] for each in tallies])
    whole = np.where(pixels > 0, pixels, np.nan)
    return Reliability(confidence / whole, (pixels - wrong) / whole, pixels)


def _tenths(tallies: list[Tally], scenes: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return sums over the bins of tallies as sums over tenths and scenes; a confidence of 1 belongs to the last."""
    places = [np.minimum((each.Rs * _BINS + _ROUNDING).astype(int), _BINS - 1) for each in tallies]
    tenths = [np.bincount(*each, _BINS) for each in zip(places, scenes, strict=True)]
    total: NDArray[np.float64] = np.sum(tenths, axis=0)
    return total


def reliability_figure(found: Reliability, *, title: str, mask: str = "all", threshold: float = 1.0) -> Figure:
    """Return the diagram, and below it how many pixels each bin has. Bins of fewer than 50 pixels are left out."""
    figure = new_figure(title)
    figure.set_size_inches(6.2, 6)
    upper, lower = figure.subplots(2, 1, height_ratios=(4, 1), sharex=True)
    _draw_shares(upper, found)
    upper.set_ylabel(f"share of pixels (mask {mask})\noff by at most {threshold:g} px (0 to 1)")
    centres = (np.arange(_BINS) + 0.5) / _BINS
    lower.bar(centres, found.pixels / max(found.pixels.sum(), 1), 0.9 / _BINS, color=SKY)
    lower.set(xlabel="confidence (0 to 1)", ylabel="share of\npixels (0 to 1)", xlim=(0, 1))
    for axes in (upper, lower):
        axes.grid(alpha=0.3)
    return figure


def _draw_shares(axes: Axes, found: Reliability) -> None:
    axes.plot([0, 1], [0, 1], color=QUIET, linestyle="--", linewidth=1.5, label="as sure as it should be")
    told = found.pixels >= _FEWEST
    label = f"this confidence (expected calibration error {found.error:.3f})"
    axes.plot(found.confidence[told], found.right[told], color=BLUE, marker="o", linewidth=1.8, label=label)
    axes.set_ylim(0, 1)
    axes.legend(loc="lower right", frameon=False)
