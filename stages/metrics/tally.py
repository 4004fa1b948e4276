"""What every threshold R leaves of a scene's map, from one pass over its rows.

``Errors`` decides which pixels count and what their errors are, as for every other figure. The pixels are sorted into
bins between neighbouring thresholds; sums over the bins above a threshold are the figures at it.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semidense.stages.metrics.errors import MASKS, THRESHOLDS, Errors, counted, pixels_of

STEPS = tuple(index / 100 for index in range(101))
"""The thresholds R that a user sets: 0 to 1 in steps of 0.01."""
FINE = tuple(sorted({*STEPS, *(1 - 10 ** (-tenth / 10) for tenth in range(21, 61))}))
"""``STEPS`` and, above 0.99, ten thresholds a power of ten: half of the pixels may lie there."""
Sums = NDArray[np.float64]


class Block(NamedTuple):
    """Some rows of a scene: raw disparity, confidence, true disparity, and which pixels both views see."""

    disparity: NDArray[Any]
    confidence: NDArray[Any]
    truth: NDArray[Any]
    nonocc: NDArray[Any]


@dataclass(frozen=True)
class Tally:
    """Counts and sums over the pixels whose confidence lies in ``[Rs[i], Rs[i + 1])``, for each mask of ``MASKS``.

    Attributes:
        Rs: (bin,) the thresholds, rising.
        pixels: (mask,) pixels that count, with a disparity or without.
        raw_wrong: (mask, threshold) those off by more than each of ``THRESHOLDS``, or without a disparity.
        reported: (mask, bin) pixels with a disparity and a confidence.
        wrong: (mask, threshold, bin) those of them off by more than the threshold.
        confidence: (mask, bin) sum of their confidences.
        absolute: (mask, bin) sum of their errors, px.
        squared: (mask, bin) sum of the squares of their errors, px².
    """

    Rs: Sums
    pixels: Sums
    raw_wrong: Sums
    reported: Sums
    wrong: Sums
    confidence: Sums
    absolute: Sums
    squared: Sums

    @classmethod
    def of(cls, blocks: Iterable[Block], Rs: Iterable[float] = FINE) -> "Tally":
        """Count a scene, block by block, at the thresholds ``Rs``: rising, the first 0."""
        found = cls._empty(np.array(list(Rs)))
        for block in blocks:
            for mask, chosen in enumerate(pixels_of(block.nonocc.astype(bool))):
                errors = Errors.of(block.disparity, block.truth, chosen)
                found._add(mask, errors.absolute, block.confidence[counted(block.truth, chosen)])
        return found

    @classmethod
    def _empty(cls, Rs: Sums) -> "Tally":
        masks, thresholds, bins = len(MASKS), len(THRESHOLDS), Rs.size
        shapes = ((masks,), (masks, thresholds), (masks, bins), (masks, thresholds, bins), *[(masks, bins)] * 3)
        return cls(Rs, *(np.zeros(shape) for shape in shapes))

    def _add(self, mask: int, error: Sums, sure: NDArray[Any]) -> None:
        self.pixels[mask] += error.size
        self.raw_wrong[mask] += [np.count_nonzero(error > threshold) for threshold in THRESHOLDS]
        usable = np.isfinite(error) & ~np.isnan(sure)
        error, sure = error[usable], sure[usable]
        # A threshold is rounded to the confidence's type, as the filter does.
        bins = np.searchsorted(self.Rs.astype(sure.dtype), sure, side="right") - 1
        for sums, weights in (
            (self.reported, np.ones(error.size)),
            (self.confidence, sure),
            (self.absolute, error),
            (self.squared, error**2),
        ):
            sums[mask] += np.bincount(bins, weights, self.Rs.size)
        for index, threshold in enumerate(THRESHOLDS):
            self.wrong[mask, index] += np.bincount(bins, error > threshold, self.Rs.size)

    def rows(self, scene: str, mask: str = "nonocc", threshold: float = 1.0) -> list[dict[str, Any]]:
        """Return the figures at every R, named as in the metrics rows: what does not apply is absent.

        ``scene, mask, threshold_px, R, pixels, invalid`` and, where something is kept, ``bad, avgerr, rms``; of a scene
        without a pixel that counts nothing.
        """
        m, t = MASKS.index(mask), THRESHOLDS.index(threshold)
        pixels = self.pixels[m]
        kept, wrong, absolute, squared = (
            _above(sums[m]) for sums in (self.reported, self.wrong[:, t], self.absolute, self.squared)
        )
        head = {"scene": scene, "mask": mask, "threshold_px": threshold, "pixels": int(pixels)}
        return [
            head
            | {"R": float(R), "invalid": float(100 * (pixels - kept[i]) / pixels)}
            | (_figures(kept[i], wrong[i], absolute[i], squared[i]) if kept[i] else {})
            for i, R in enumerate(self.Rs)
            if pixels
        ]

    def raw_bad(self, mask: str = "nonocc", threshold: float = 1.0) -> float:
        """Return the percentage of pixels that the map before filtering gets wrong or leaves out; NaN without any."""
        m, t = MASKS.index(mask), THRESHOLDS.index(threshold)
        return float(100 * self.raw_wrong[m, t] / self.pixels[m]) if self.pixels[m] else float("nan")


def _above(sums: Sums) -> Sums:
    """Return for each bin the sum over it and all above."""
    return sums[::-1].cumsum()[::-1]


def _figures(kept: float, wrong: float, absolute: float, squared: float) -> dict[str, float]:
    return {"bad": float(100 * wrong / kept), "avgerr": float(absolute / kept), "rms": float(np.sqrt(squared / kept))}
