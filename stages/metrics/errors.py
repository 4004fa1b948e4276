"""Errors of a disparity map against ground truth.

Everywhere here: ``disparity`` and ``truth`` are float arrays of one shape, px, and ``mask`` a bool array of it. A pixel
*counts* where the mask is set and the truth is finite; it is *reported* where the disparity is finite too. Every
function raises ``StageError`` if the shapes differ or the mask is not bool, and gives NaN, without a warning, when it
has no pixel to speak of.

Source: the measures of the Middlebury stereo evaluation, version 3.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.stage import Array, StageError

MASKS = ("nonocc", "all")
"""The pixels that count: those that both views see, and all; of both only those whose truth is known."""
THRESHOLDS = (0.5, 1.0, 2.0, 4.0)
"""Errors above which a pixel is wrong, px of the image at hand."""
QUANTILES = {"A50": 0.50, "A90": 0.90, "A95": 0.95, "A99": 0.99}
"""Shares of the reported pixels whose largest error is given."""


@dataclass(frozen=True)
class Errors:
    """The absolute errors of a map, worked out once; every figure of a map is made from them.

    Attributes:
        absolute: (pixel,) float64, px, of each pixel that counts, in the order of the array; infinity where nothing is
            reported. The difference is taken in float64, so that an error at a threshold is not pushed over it.
        reported: (pixel,) those of the reported pixels alone.
    """

    absolute: NDArray[np.float64]
    reported: NDArray[np.float64]

    @classmethod
    def of(cls, disparity: NDArray[Any], truth: NDArray[Any], mask: NDArray[np.bool_]) -> "Errors":
        """Compare a map with the ground truth."""
        require_equal("disparity", disparity, truth)
        counts = counted(truth, mask)
        absolute = np.abs(disparity[counts].astype(np.float64) - truth[counts])
        reported = np.isfinite(absolute)
        return cls(np.where(reported, absolute, np.inf), absolute[reported])

    def bad(self, threshold: float) -> float:
        """Return the percentage of reported pixels off by more than the threshold."""
        return percentage(self.reported > threshold)

    def raw_bad(self, threshold: float) -> float:
        """Return the percentage of pixels off by more than the threshold or not reported."""
        return percentage(self.absolute > threshold)

    def invalid(self) -> float:
        """Return the percentage of pixels not reported."""
        return percentage(np.isinf(self.absolute))

    def avgerr(self) -> float:
        """Return the mean error of the reported pixels."""
        return float(self.reported.mean()) if self.reported.size else float("nan")

    def rms(self) -> float:
        """Return the root mean squared error of the reported pixels."""
        return float(np.sqrt(np.mean(self.reported**2))) if self.reported.size else float("nan")

    def quantiles(self) -> dict[str, float]:
        """Return ``A50``, ``A90``, ``A95`` and ``A99`` of the reported pixels, px.

        ``A90`` is the smallest error that occurs and that at least 90 % of them do not exceed (no interpolation).
        """
        if not self.reported.size:
            return dict.fromkeys(QUANTILES, float("nan"))
        found = np.quantile(self.reported, list(QUANTILES.values()), method="inverted_cdf")
        return dict(zip(QUANTILES, found.tolist(), strict=True))


def raw_bad(disparity: NDArray[Any], truth: NDArray[Any], mask: NDArray[np.bool_], threshold: float) -> float:
    """Return the percentage (0-100) of pixels that are off by more than ``threshold`` px or not reported at all.

    So an empty map is 100 % wrong. NaN if no pixel counts.

    >>> raw_bad(np.array([1.0, 2.0, np.nan, 5.0]), np.array([1.0, 4.0, 3.0, 5.0]), np.ones(4, bool), threshold=1)
    50.0
    """
    return Errors.of(disparity, truth, mask).raw_bad(threshold)


def pixels_of(nonocc: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], ...]:
    """Return the pixels (y, x) of each of ``MASKS``, given those that both views see."""
    return nonocc, np.ones_like(nonocc)


def counted(truth: NDArray[Any], mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where a pixel counts: in the mask, with a finite truth."""
    if mask.dtype != np.bool_:
        raise StageError(f"mask has dtype {mask.dtype}, expected bool: an index mask would count other pixels")
    require_equal("mask", mask, truth)
    known: NDArray[np.bool_] = np.isfinite(truth)
    return mask & known


def percentage(chosen: NDArray[np.bool_]) -> float:
    """Return the share of True, 0-100; NaN for an empty array."""
    return 100 * int(np.count_nonzero(chosen)) / chosen.size if chosen.size else float("nan")


def require_equal(name: str, array: Array, truth: Array) -> None:
    """Refuse an array that has not the shape of the ground truth.

    Raises:
        StageError: naming it and both shapes.
    """
    if array.shape != truth.shape:
        raise StageError(f"{name} has shape {array.shape}, the ground truth {truth.shape}: they must be equal")
