"""Right and wrong pixels by confidence, and what comes of a threshold or a wanted error.

A table has a row a scene and counts pixels by the log-odds of their confidence. Every scene weighs the same, however
many of its pixels have a known truth.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semidense.stages.evaluation.calibration.declaration import BINS, LARGEST
from semidense.stages.stage import Arrays

EDGES = np.linspace(-LARGEST, LARGEST, BINS + 1)
"""Log-odds between which the bins lie; the first and the last bin take what lies beyond."""
Floats = NDArray[np.float64]


def log_odds(confidence: NDArray[np.floating]) -> Floats:
    """Return ``ln(p / (1 - p))``: float64, infinite at 0 and 1, NaN where there is no confidence."""
    share = confidence.astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        odds: Floats = np.log(share) - np.log1p(-share)
    return odds


def probability(odds: Floats) -> Floats:
    """Return the probability of log-odds: ``1 / (1 + exp(-z))``."""
    result: Floats = (1 + np.tanh(odds / 2)) / 2
    return result


@dataclass(frozen=True)
class Table:
    """Pixels by confidence.

    Attributes:
        right: (scene, bin) counts of right pixels.
        wrong: (scene, bin) counts of wrong ones.
    """

    right: NDArray[np.int64]
    wrong: NDArray[np.int64]

    @classmethod
    def of(cls, calibration: Arrays) -> "Table":
        """Return the table of the product ``calibration``."""
        return cls(calibration["right"], calibration["wrong"])

    def scenes(self, chosen: NDArray[np.bool_]) -> "Table":
        """Return the table of some of the scenes."""
        return Table(self.right[chosen], self.wrong[chosen])

    @property
    def shares(self) -> tuple[Floats, Floats]:
        """Right and wrong pixels by confidence, as shares of a scene's pixels, summed over the scenes: (bin,) each.

        The first bin counts as empty. It holds what a veto set to 0, which is no probability: most of it is right.
        """
        pixels = np.maximum((self.right + self.wrong).sum(axis=1, keepdims=True), 1)
        right, wrong = ((counts / pixels).sum(axis=0) for counts in (self.right, self.wrong))
        right[0] = wrong[0] = 0
        return right, wrong


def tally(
    confidence: NDArray[np.float32], disparity: NDArray[np.float32], truth: NDArray[np.float32], tolerance: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Count right and wrong pixels of one scene by confidence: (bin,) each.

    Args:
        confidence: (y, x) in [0, 1].
        disparity: (y, x) raw, px. A pixel without one is never kept and is not counted.
        truth: (y, x) px, NaN where unknown; such pixels are not counted. Hidden pixels are, where their truth is known.
        tolerance: largest error of a right disparity, px.
    """
    counted = np.isfinite(truth) & np.isfinite(disparity) & np.isfinite(confidence)
    scaled = (log_odds(confidence[counted]) + LARGEST) * (BINS / (2 * LARGEST))
    bins = np.floor(np.clip(scaled, 0, BINS - 1)).astype(np.intp)
    right = np.abs(disparity[counted] - truth[counted]) <= tolerance
    return np.bincount(bins[right], minlength=BINS), np.bincount(bins[~right], minlength=BINS)


class Choice(NamedTuple):
    """A threshold and what it does in the scenes of a table.

    Attributes:
        R: least confidence that is kept.
        error: share of wrong pixels among the kept, mean over the scenes that keep any.
        kept: share of the pixels that is kept, mean over the scenes.
    """

    R: float
    error: float
    kept: float


def choices(table: Table) -> list[Choice]:
    """Return every threshold at the edge of a bin, rising, at which all scenes keep something; R = 0 is the first."""
    kept, wrong = (_above(counts) for counts in (table.right + table.wrong, table.wrong))
    all_keep = (kept > 0).all(axis=0)
    error = (wrong / np.maximum(kept, 1)).mean(axis=0)
    share = (kept / np.maximum(kept[:, :1], 1)).mean(axis=0)
    thresholds = np.r_[0.0, probability(EDGES[1:-1])]
    return [Choice(float(thresholds[bin]), float(error[bin]), float(share[bin])) for bin in np.flatnonzero(all_keep)]


class Outcome(NamedTuple):
    """What a wanted error came to in the scenes of a table.

    Attributes:
        error: share of wrong pixels among the kept, mean over the scenes that keep any; NaN if none does.
        kept: share of the pixels that is kept, mean over the scenes.
        scenes: how many scenes there are.
        tolerances: errors above which a pixel is wrong, px, rising; a second one is that of sparse truths.
    """

    error: float
    kept: float
    scenes: int
    tolerances: tuple[float, ...]

    @property
    def words(self) -> str:
        """What it rests on."""
        scenes = f"{self.scenes} training scenes that the networks had not seen"
        if not self.kept:
            return f"in {scenes} no pixel was sure enough for that error"
        least, *larger = self.tolerances
        sparse = f" ({larger[-1]:g} px where a laser measured the truth)" if larger else ""
        return (
            f"in {scenes} the same wish kept {100 * self.kept:.3g} % of the pixels, {100 * self.error:.3g} % of them "
            f"wrong by more than {least:g} px{sparse}"
        )


def outcome(table: Table, mapped: Floats, max_error: float, tolerance: Floats) -> Outcome:
    """Return what comes of keeping in each scene as many pixels as are expected to keep the error.

    The pixels of the first bin are never kept: it holds what a veto set to 0.

    Args:
        table: of scenes that the networks have not seen.
        mapped: calibrated log-odds at ``EDGES``.
        max_error: mean probability of being wrong among the kept, at most, in (0, 1).
        tolerance: (scene,) error up to which a pixel of the scene was counted as right, px.
    """
    pixels = table.right + table.wrong
    total, seen = pixels.sum(axis=1), pixels[:, 1:]
    sums, wrong = _above(seen), _above(table.wrong[:, 1:])
    expected = _above(seen * probability(-(mapped[2:] + mapped[1:-1]) / 2))
    kept, errors = [], []
    for scene, reached in enumerate((sums > 0) & (expected <= max_error * sums)):
        least = int(np.argmax(reached))
        kept.append(sums[scene, least] / total[scene] if reached.any() else 0.0)
        if reached.any():
            errors.append(wrong[scene, least] / sums[scene, least])
    tolerances = tuple(np.unique(tolerance).tolist())
    return Outcome(float(np.mean(errors)) if errors else float("nan"), float(np.mean(kept)), len(kept), tolerances)


def told(R: float) -> str:
    """Return a threshold as people read it, with as many digits as tell it from 1.

    >>> told(0.9), told(0.93412), told(0.99921)
    ('0.900', '0.934', '0.99921')
    """
    return f"{R:.3f}" if R < 0.99 else f"{R:.5f}"


def _above(counts: NDArray[Any]) -> NDArray[Any]:
    """Return the sums over each bin and all above it."""
    return np.cumsum(counts[:, ::-1], axis=1)[:, ::-1]
