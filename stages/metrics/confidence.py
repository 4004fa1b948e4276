"""How well a confidence ranks pixels: the area under the error curve, and points of the curve.

Sort the n pixels by falling confidence. Keeping the first k, with W_k wrong among them, gives density ``k / n`` and
error ``W_k / k``. Pixels of equal confidence have no order: W_k is then its mean over all orders of theirs, which is a
straight line between the ends of their group. A NaN confidence counts as minus infinity.

Source: Hu & Mordohai, "A quantitative evaluation of confidence measures for stereo vision", PAMI 2012.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.stages.stage import StageError, require_share


@dataclass(frozen=True)
class Ranking:
    """Pixels sorted by confidence, once for every threshold on the error.

    Attributes:
        order: (n,) indices of the pixels, most confident first.
        sizes: (group,) numbers of pixels of equal confidence, in that order; they sum to n.
    """

    order: NDArray[np.intp]
    sizes: NDArray[np.intp]

    @classmethod
    def of(cls, confidence: NDArray[Any]) -> "Ranking":
        """Rank pixels by their confidence, of any shape and any scale; O(n log n)."""
        falling = -np.where(np.isnan(confidence), -np.inf, confidence).ravel()
        order = np.argsort(falling)
        ranked = falling[order]
        starts = np.flatnonzero(np.r_[ranked.size > 0, ranked[1:] != ranked[:-1]][: ranked.size])
        return cls(order, np.diff(starts, append=order.size))

    def wrong(self, correct: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the expected number of wrong pixels among the first k, for k = 1 ... n: (n,)."""
        self._require_fit(correct)
        in_groups = self._sums(np.where(correct.ravel()[self.order], 0.0, 1.0))
        return np.cumsum(np.repeat(in_groups / self.sizes, self.sizes))

    @cached_property
    def weights(self) -> NDArray[np.float64]:
        """What each pixel adds to the area if it is wrong: (n,), in the order of the confidences.

        A wrong pixel at place p counts in W_p ... W_n, so it adds ``1/n (1/p + ... + 1/n)``; tied pixels share the
        mean of what their places add.
        """
        n = self.order.size
        tails = np.cumsum(1 / np.arange(n, 0, -1))[::-1] / n
        weights = np.empty(n)
        weights[self.order] = np.repeat(self._sums(tails) / self.sizes, self.sizes)
        return weights

    def auc(self, correct: NDArray[np.bool_]) -> float:
        """Return the area under the error curve; see the function ``auc``."""
        self._require_fit(correct)
        return float(self.weights[~correct.ravel()].sum()) if correct.size else float("nan")

    def _sums(self, ranked: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the sum of ranked values in each group of equal confidence."""
        if not ranked.size:
            return ranked
        return np.add.reduceat(ranked, np.cumsum(self.sizes) - self.sizes)

    def _require_fit(self, correct: NDArray[np.bool_]) -> None:
        if correct.dtype != np.bool_ or correct.size != self.order.size:
            raise StageError(
                f"correct is {correct.dtype} {correct.shape}, expected bool, one for each of {self.order.size} pixels"
            )


def auc(confidence: NDArray[Any], correct: NDArray[np.bool_]) -> float:
    """Return the area under the curve of error against density; lower is better.

    ``AUC = 1/n sum_k W_k / k`` over every k = 1 ... n, the discrete sum over all densities ``k / n``; ties count with
    their expected value, exactly. A confidence that ranks every right pixel first reaches ``optimal_auc`` up to
    ``e / n``; one that is the same everywhere gives the error rate e.

    Args:
        confidence: any shape, higher is surer; NaN counts as minus infinity.
        correct: bool, as many; an unreported pixel is not correct.

    Returns:
        A fraction in [0, 1]; NaN without a pixel.

    Raises:
        StageError: if ``correct`` is not bool or the numbers of pixels differ.

    >>> auc(np.array([0.9, 0.8, 0.1, 0.1]), np.array([True, True, True, False]))
    0.10416666666666666
    """
    return Ranking.of(confidence).auc(correct)


def optimal_auc(error_rate: float) -> float:
    """Return the area that a perfect ranking reaches: ``e + (1 - e) ln(1 - e)``.

    It is the integral; the sum of ``auc`` over n pixels, perfectly ranked, lies above it by at most ``e / n``.

    Args:
        error_rate: share of wrong pixels, a fraction in [0, 1]; NaN gives NaN.

    Returns:
        A fraction in [0, 1].

    Raises:
        StageError: if the error rate is outside [0, 1].

    >>> optimal_auc(0.0), round(optimal_auc(0.5), 6), optimal_auc(1.0)
    (0.0, 0.153426, 1.0)
    """
    if np.isnan(error_rate):
        return float("nan")
    require_share("error rate", error_rate)
    if error_rate == 1:
        return 1.0
    return float(error_rate + (1 - error_rate) * np.log1p(-error_rate))


def error_at_density(confidence: NDArray[Any], correct: NDArray[np.bool_], density: float) -> float:
    """Return the percentage (0-100) of wrong pixels among the most confident share ``density``.

    ``100 W_k / k`` at ``k = density n``; between whole k, W is a straight line. Ties as in ``auc``.

    Args:
        confidence: any shape, higher is surer; NaN counts as minus infinity.
        correct: bool, as many; an unreported pixel is not correct, so a density above the share of reported pixels
            counts some of them as wrong.
        density: share of the pixels that is kept, a fraction in (0, 1].

    Returns:
        0-100; NaN without a pixel.

    Raises:
        StageError: if the density is outside (0, 1], ``correct`` is not bool or the numbers of pixels differ.

    >>> error_at_density(np.array([0.9, 0.8, 0.7, 0.1]), np.array([True, False, True, False]), density=0.5)
    50.0
    """
    if not 0 < density <= 1:
        raise StageError(f"density is {density:g}, expected a number in (0, 1]")
    wrong = Ranking.of(confidence).wrong(correct)
    if not wrong.size:
        return float("nan")
    kept = density * wrong.size
    return 100 * float(np.interp(kept, np.arange(wrong.size + 1), np.r_[0, wrong])) / kept
