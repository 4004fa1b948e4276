"""Read a scene's cached products for a page: maps small enough for a screen, and figures over every pixel."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semidense.cache import Store
from semidense.pipeline.figures.colours import view_rgb
from semidense.pipeline.plan.images_and_truth import MASK_KINDS
from semidense.stages.metrics.tally import Block, Tally


@dataclass(frozen=True, eq=False)
class SceneMaps:
    """The maps of a scene; of a large scene every ``step``-th row and column. A map is None if it is not cached.

    Attributes:
        size: rows and columns of the image, px.
        step: how many px lie between neighbours of a map.
        left: (y, x, 3) uint8, the reference view.
        disparity: (y, x) float32, px, before filtering.
        confidence: (y, x) float32 in [0, 1].
        truth: (y, x) float32, px, NaN unknown.
        nonocc: (y, x) bool, pixels that both views see and whose truth is known.
        mask_kind: where the mask of pixels that both views see comes from.
    """

    size: tuple[int, int]
    step: int
    left: NDArray[np.uint8] | None
    disparity: NDArray[np.float32] | None
    confidence: NDArray[np.float32] | None
    truth: NDArray[np.float32] | None
    nonocc: NDArray[np.bool_] | None
    mask_kind: str
    _arrays: Mapping[str, Mapping[str, Any]]

    @classmethod
    def read(cls, store: Store, keys: Mapping[str, str]) -> "SceneMaps":
        """Read the maps of the cached products of a scene.

        Args:
            store: the cache.
            keys: keys of the products of one scene and configuration; ``images`` or ``disparity`` must be there.

        Raises:
            CacheError: if one of them is missing or damaged.
        """
        shown = ("images", "disparity", "confidence", "truth", "semidense")
        arrays = {product: store.arrays(keys[product]) for product in shown if product in keys}
        height, width = (arrays["images"]["left"] if "images" in arrays else arrays["disparity"]["disparity"]).shape[:2]
        step = step_for(height, width)
        maps = {
            name: thinned(arrays[name]["confidence" if name == "confidence" else "disparity"], step)
            for name in shown[1:4]
            if name in arrays
        }
        return cls(
            size=(height, width),
            step=step,
            left=view_rgb(thinned(arrays["images"]["left"], step)) if "images" in arrays else None,
            disparity=maps.get("disparity"),
            confidence=maps.get("confidence"),
            truth=maps.get("truth"),
            nonocc=thinned(arrays["truth"]["nonocc"], step).astype(bool) if "truth" in arrays else None,
            mask_kind=MASK_KINDS[int(np.asarray(arrays["truth"]["mask_kind"][...])[0])] if "truth" in arrays else "",
            _arrays=arrays,
        )

    @cached_property
    def kept(self) -> NDArray[np.float32] | None:
        """The cached filtered map, (y, x) float32, px, NaN not kept; None if it is not cached."""
        return thinned(self._arrays["semidense"]["disparity"], self.step) if "semidense" in self._arrays else None

    @cached_property
    def tally(self) -> Tally | None:
        """The figures at every R, over all pixels; None unless raw map, confidence and truth are cached."""
        return Tally.of(self._blocks()) if {"disparity", "confidence", "truth"} <= set(self._arrays) else None

    def _blocks(self) -> Iterator[Block]:
        """Yield all rows of the scene, a few at a time."""
        disparity, confidence = self._arrays["disparity"]["disparity"], self._arrays["confidence"]["confidence"]
        truth, nonocc = (self._arrays["truth"][name] for name in ("disparity", "nonocc"))
        for rows in row_blocks(disparity):
            yield Block(*(np.asarray(array[rows]) for array in (disparity, confidence, truth, nonocc)))

    def error(self) -> NDArray[np.float32] | None:
        """Return the absolute error of the raw map, px; NaN where one has no value; None unless both are cached."""
        if self.disparity is None or self.truth is None:
            return None
        error: NDArray[np.float32] = np.abs(self.disparity - self.truth)
        return error


SHOWN = 1_500_000
"""Most pixels of a map on a page: Middlebury's quarter and half size fit, larger images are thinned."""
_BLOCK = 2_000_000
"""Elements that are read at a time, roughly."""


def step_for(height: int, width: int, most: int = SHOWN) -> int:
    """Return n such that every n-th row and column of an image makes at most ``most`` pixels.

    >>> step_for(500, 741), step_for(2000, 3000)
    (1, 2)
    """
    step = max(1, math.isqrt(height * width // most))
    while -(-height // step) * -(-width // step) > most:
        step += 1
    return step


def row_blocks(array: Any) -> Iterator[slice]:  # noqa: ANN401 - zarr's arrays and NumPy's alike
    """Yield the rows of an array (y, ...) in blocks of whole chunks, small enough to hold several."""
    height, chunk = array.shape[0], getattr(array, "chunks", array.shape)[0]
    row = max(1, math.prod(array.shape[1:]))
    rows = max(1, _BLOCK // (row * chunk)) * chunk
    return (slice(start, min(start + rows, height)) for start in range(0, height, rows))


def thinned(array: Any, step: int) -> NDArray[Any]:  # noqa: ANN401
    """Return every ``step``-th row and column of an array (y, x, ...), never holding more than a block of it.

    >>> thinned(np.arange(12).reshape(3, 4), 2).tolist()
    [[0, 2], [8, 10]]
    """
    parts = [np.asarray(array[rows])[-rows.start % step :: step, ::step] for rows in row_blocks(array)]
    return np.concatenate(parts)
