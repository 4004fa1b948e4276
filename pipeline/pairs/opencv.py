"""A drop-in for those who call OpenCV's ``StereoSGBM``."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semidense.pipeline.pairs.match import Match, match
from semidense.pipeline.plan.errors import UsageError


class StereoMatcher:
    """Match pairs through ``compute(left, right)``, with OpenCV's names for what they share.

    As in OpenCV, colour images are in the order blue, green, red, and disparities lie in ``minDisparity`` to
    ``minDisparity + numDisparities - 1``. Not as in OpenCV, a map is float32 in pixels (not 16 times as much in int16),
    with NaN for "none" (not ``minDisparity - 1``).

    >>> StereoMatcher(minDisparity=-4, numDisparities=64, R=0.8).getNumDisparities()
    64
    """

    def __init__(
        self,
        minDisparity: int = 0,
        numDisparities: int = 64,
        *,
        R: float | None = None,
        density: float | None = None,
        settings: Sequence[str] = (),
        cache: Path | str | None = None,
        **wishes: Any,  # noqa: ANN401 - those of Wishes
    ) -> None:
        """Set what to search and what to keep.

        Args:
            minDisparity: px.
            numDisparities: how many, from 1; no multiple of 16 is needed.
            R: least confidence that is kept; by default 0.9.
            density: share of the pixels to keep instead.
            settings: ``section.field=value`` of the configuration.
            cache: the cache's folder.
            **wishes: further attributes of ``semidense.pipeline.pairs.match.Wishes``, such as ``subpixel=True``.

        Raises:
            UsageError: if there is no disparity to search.
        """
        if numDisparities < 1:
            raise UsageError(f"numDisparities is {numDisparities}; it must be at least 1")
        self._range = range(minDisparity, minDisparity + numDisparities)
        self._how: dict[str, Any] = {"settings": settings, "cache": cache, "R": R, "density": density, **wishes}
        self._found: Match | None = None

    @classmethod
    def create(cls, *arguments: Any, **named: Any) -> Self:  # noqa: ANN401
        """Make a matcher, as ``StereoSGBM.create`` does."""
        return cls(*arguments, **named)

    def compute(self, left: NDArray[Any], right: NDArray[Any]) -> NDArray[np.float32]:
        """Return the disparities of the left view: (y, x) float32, px, NaN where there is none.

        Args:
            left: (y, x) gray, (y, x, 3) blue, green, red, or (y, x, 4) with alpha, which is dropped; uint8 or uint16.
            right: the other view.

        Raises:
            DatasetError: if an array is no image, or the two do not fit together.
        """
        self._found = match(_rgb(left), _rgb(right), d_min=self._range[0], d_max=self._range[-1], **self._how)
        return self._found.disparity

    @property
    def confidence(self) -> NDArray[np.float32]:
        """(y, x) float32 in [0, 1], of the last ``compute``: how sure each raw disparity is.

        Raises:
            UsageError: before the first ``compute``.
        """
        if self._found is None:
            raise UsageError("there is no confidence before compute(left, right)")
        return self._found.confidence

    def getMinDisparity(self) -> int:  # noqa: N802 - OpenCV's name
        """Return the smallest disparity, px."""
        return self._range[0]

    def getNumDisparities(self) -> int:  # noqa: N802
        """Return how many disparities are searched."""
        return len(self._range)


def _rgb(view: NDArray[Any]) -> NDArray[Any]:
    """Return OpenCV's blue, green, red (and alpha) as red, green, blue; anything else as it is."""
    return view[..., 2::-1] if np.shape(view)[2:] in ((3,), (4,)) else view
