"""The rank transform: it keeps the order of brightness and drops the brightness, and with it the lighting."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stages.kernel import inlined, kernel
from stages.transforms.gray import require_gray
from stages.transforms.window import require_window

BANDS = 16
"""Bands of gray levels, and levels in a band."""


def rank(gray: NDArray[np.uint8], window: int = 31) -> NDArray[np.float32]:
    """Return the share of window pixels that are brighter than the centre.

    ``R(p) = |{q in N_p : I(q) > I(p)}| / |N_p|`` with ``N_p`` the ``window x window`` pixels around p, p among
    them, cut at the image border: ``|N_p|`` counts the pixels that are left.

    A histogram of each column of the window runs down the image, and their sum runs along each row, in two levels: 16
    bands of 16 levels each are summed for every pixel, the levels of a band only where a pixel lies in that band
    (Perreault & Hebert, IEEE TIP 2007). So a pixel's cost hardly depends on the window.

    Args:
        gray: (y, x) uint8.
        window: side of the window, px, odd, at least 3; it may exceed the image.

    Returns:
        (y, x) float32, a pure number in [0, 1): the float32 nearest to the exact quotient.

    Raises:
        StageError: if ``gray`` is not an 8-bit gray image or ``window`` is even or below 3.

    Source: Zabih & Woodfill, ECCV 1994, as a share of the window.

    >>> rank(np.array([[1, 2, 3]], np.uint8), window=3).tolist()
    [[0.5, 0.3333333432674408, 0.0]]
    """
    require_gray(gray)
    require_window(window)
    radius = min(window // 2, max(gray.shape))
    counter = np.uint16 if window <= 255 else np.uint32  # holds window ** 2; the narrower, the faster
    out = np.empty(gray.shape, np.float32)
    _rank(gray, radius, (0,) * (2 * np.dtype(counter).itemsize), _histograms(gray.shape[1], radius, counter), out)
    return out


class _Histograms(NamedTuple):
    """Counters of a band, or of a band's levels, lie side by side: several of them are added as one 64-bit word.

    Attributes:
        bands: (column, band) pixels of each band; there are columns beyond the image, which stay empty.
        band_words: the same memory, (column, word).
        levels: (band, column, level) pixels of each level.
        level_words: the same memory, (band, column, word).
        above: (bin, word) all ones in the counters after a bin, zeros in the others.
        ones: a one in each counter of a word: times a word, it leaves the sum of the counters in the topmost.
        shift: by which the topmost counter comes down.
    """

    bands: NDArray[Any]
    band_words: NDArray[np.uint64]
    levels: NDArray[Any]
    level_words: NDArray[np.uint64]
    above: NDArray[np.uint64]
    ones: np.uint64
    shift: np.uint64


def _histograms(width: int, radius: int, counter: type[Any]) -> _Histograms:
    """Return empty histograms for an image of ``width`` columns."""
    columns, bits = width + 2 * radius + 1, 8 * np.dtype(counter).itemsize
    bands, levels = np.zeros((columns, BANDS), counter), np.zeros((BANDS, columns, BANDS), counter)
    bins = np.arange(BANDS)
    above = np.where(bins > bins[:, None], np.iinfo(counter).max, 0).astype(counter)
    ones = np.uint64(sum(1 << place for place in range(0, 64, bits)))
    words = (each.view(np.uint64) for each in (bands, levels, above))
    band_words, level_words, above_words = words
    return _Histograms(bands, band_words, levels, level_words, above_words, ones, np.uint64(64 - bits))


@kernel
def _rank(
    gray: NDArray[np.uint8], radius: int, words: tuple[int, ...], h: _Histograms, out: NDArray[np.float32]
) -> None:
    """Rank each pixel; ``words`` is as long as a histogram has words, which the compiler then knows."""
    height, width = gray.shape
    side, band_words, level_words, above = 2 * radius + 1, h.band_words, h.level_words, h.above
    total = np.zeros(len(words), np.uint64)
    parts = np.zeros((BANDS, len(words)), np.uint64)
    current = np.empty(BANDS, np.int64)
    for y in range(-radius, height):
        if y + radius < height:
            _count(h.bands, h.levels, gray[y + radius], radius, 1)
        if y > radius:
            _count(h.bands, h.levels, gray[y - radius - 1], radius, -1)
        if y < 0:
            continue
        total[:] = 0
        for column in range(side):
            for word in range(len(words)):
                total[word] += band_words[column, word]
        current[:] = -side
        down = min(height, y + radius + 1) - max(0, y - radius)
        for x in range(width):  # the window's columns are x + 1 ... x + side
            for word in range(len(words)):
                total[word] += band_words[x + side, word] - band_words[x, word]
            band, level = gray[y, x] >> 4, gray[y, x] & 15
            _catch_up(level_words, parts, band, current[band], x, side, len(words))
            current[band] = x
            brighter = np.uint64(0)
            for word in range(len(words)):
                brighter += (total[word] & above[band, word]) + (parts[band, word] & above[level, word])
            across = min(width, x + radius + 1) - max(0, x - radius)
            out[y, x] = np.int64((brighter * h.ones) >> h.shift) / (down * across)


@kernel
def _count(bands: NDArray[Any], levels: NDArray[Any], row: NDArray[np.uint8], radius: int, sign: int) -> None:
    """Let a row of the image enter (1) or leave (-1) the histograms of the columns."""
    for x in range(row.size):
        band, column = row[x] >> 4, x + radius + 1
        bands[column, band] += sign
        levels[band, column, row[x] & 15] += sign


@inlined
def _catch_up(
    columns: NDArray[np.uint64], parts: NDArray[np.uint64], band: int, current: int, x: int, side: int, words: int
) -> None:
    """Bring the sum of a band's levels from the window at ``current`` to the one at ``x``, by the shorter way."""
    if 2 * (x - current) > side:
        parts[band] = 0
        for column in range(x + 1, x + side + 1):
            for word in range(words):
                parts[band, word] += columns[band, column, word]
    else:
        for column in range(current + 1, x + 1):
            for word in range(words):
                parts[band, word] += columns[band, column + side, word] - columns[band, column, word]
