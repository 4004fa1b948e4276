"""A replacement for OpenCV's ``StereoSGBM`` with the same calls."""

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semidense.datasets.arrays import as_array
from semidense.pipeline.api import Cache, Task, open_store
from semidense.pipeline.pairs.match import match
from semidense.pipeline.pairs.wishes import Wishes, refuse_unknown, wished
from semidense.pipeline.plan.arguments import require_number
from semidense.pipeline.plan.config import Settings, setting_texts
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.presets import OWN_PAIRS

_NAMED = ("minDisparity", "numDisparities", "disp12MaxDiff", "settings", "preset", "cache")
_WITHOUT_COUNTERPART = (
    *("blockSize", "P1", "P2", "preFilterCap", "preFilterType", "preFilterSize", "textureThreshold"),
    *("uniquenessRatio", "speckleWindowSize", "speckleRange", "mode"),
)
"""OpenCV's parameters of matchers that work in another way."""


class StereoMatcher:
    """Match pairs through ``compute(left, right)``, with OpenCV's names for what they share.

    As in OpenCV, colour images are in the order blue, green, red, and disparities lie in ``minDisparity`` to
    ``minDisparity + numDisparities - 1``. Not as in OpenCV, a map is float32 in pixels (not 16 times as much in int16),
    with NaN for "none" (not ``minDisparity - 1``).

    A matcher can be copied and pickled, with the confidence of its last ``compute``.

    >>> StereoMatcher(minDisparity=-4, numDisparities=64, R=0.8).getNumDisparities()
    64
    """

    def __init__(
        self,
        minDisparity: int = 0,
        numDisparities: int = 64,
        *,
        disp12MaxDiff: float = -1,
        settings: Settings = (),
        preset: str = OWN_PAIRS,
        cache: Cache = None,
        **wishes: Any,  # noqa: ANN401 - those of Wishes
    ) -> None:
        """Set what to search and what to keep. All of it is checked here, before any image is there.

        Args:
            minDisparity: px, a whole number.
            numDisparities: how many, from 1; no multiple of 16 is needed.
            disp12MaxDiff: drop disparities that the right view's map contradicts by more than this, px; below 0: none.
            settings: ``section.field=value`` of the configuration, over those of the preset.
            preset: named settings to start from: ``robust``, or ``paper`` for the method of the paper.
            cache: the cache's folder or URL, or an opened cache.
            **wishes: attributes of ``semidense.pipeline.pairs.match.Wishes``, such as ``R=0.8``, ``density=0.5`` or
                ``subpixel=True``.

        Raises:
            UsageError: if a name is unknown, a value is not valid, or OpenCV's parameter has no counterpart here.
            StageError: if an error or calibrated confidences are asked for, and such maps have no calibration.
        """
        low, count = _whole("minDisparity", minDisparity), _whole("numDisparities", numDisparities)
        if count < 1:
            raise UsageError(f"numDisparities is {count}; it must be at least 1")
        _refuse_unknown(wishes)
        if require_number("disp12MaxDiff", disp12MaxDiff) >= 0:
            if "tolerance" in wishes:
                raise UsageError("disp12MaxDiff and tolerance both say what the right view's map drops; give one")
            wishes |= {"left_right": True, "tolerance": float(disp12MaxDiff)}
        open_store(cache)
        wished(Task(settings=settings, preset=preset), Wishes(**wishes))
        self._range = range(low, low + count)
        self._how: dict[str, Any] = {
            "settings": setting_texts(settings),
            "preset": preset,
            "cache": cache,
            **wishes,
        }
        self._confidence: NDArray[np.float32] | None = None

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
        views = _rgb("left image", left), _rgb("right image", right)
        found = match(*views, d_min=self._range[0], d_max=self._range[-1], **self._how)
        self._confidence = found.confidence
        return found.disparity

    @property
    def confidence(self) -> NDArray[np.float32]:
        """(y, x) float32 in [0, 1], of the last ``compute``: how sure each raw disparity is.

        Raises:
            UsageError: before the first ``compute``.
        """
        if self._confidence is None:
            raise UsageError("there is no confidence before compute(left, right)")
        return self._confidence

    def getMinDisparity(self) -> int:  # noqa: N802 - OpenCV's name
        """Return the smallest disparity, px."""
        return self._range[0]

    def getNumDisparities(self) -> int:  # noqa: N802
        """Return how many disparities are searched."""
        return len(self._range)


def _whole(name: str, value: object) -> int:
    """Return a whole number that was given as Python's or NumPy's, or as 64.0.

    Raises:
        UsageError: if it is none.
    """
    if isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool):
        number = float(value)
        if number.is_integer():
            return int(number)
    raise UsageError(f"{name} is {value!r}; it must be a whole number")


def _refuse_unknown(wishes: Mapping[str, object]) -> None:
    for name in wishes:
        if name in _WITHOUT_COUNTERPART:
            raise UsageError(
                f"{name} of OpenCV has no counterpart here: the networks decide what matches; leave it out"
            )
    refuse_unknown("StereoMatcher", wishes, _NAMED)


def _rgb(what: str, given: object) -> NDArray[Any]:
    """Return OpenCV's blue, green, red (and alpha) as red, green, blue; anything else as it is."""
    view = as_array(what, given)
    return view[..., 2::-1] if view.shape[2:] in ((3,), (4,)) else view
