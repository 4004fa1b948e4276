"""Rank and companion against direct double loops over window and rays: ``python -m benchmarks.transforms``."""

import numba
import numpy as np
from numpy.typing import NDArray

from benchmarks.harness import compare, report
from semidense.datasets import open_dataset
from semidense.stages.transforms.companion import companion
from semidense.stages.transforms.gray import to_gray
from semidense.stages.transforms.rank import rank


@numba.njit(nogil=True)
def direct_rank(gray: NDArray[np.uint8], radius: int, out: NDArray[np.float32]) -> None:
    """Count the brighter pixels of every window, one by one."""
    height, width = gray.shape
    for y in range(height):
        for x in range(width):
            brighter = seen = 0
            for row in range(max(0, y - radius), min(height, y + radius + 1)):
                for column in range(max(0, x - radius), min(width, x + radius + 1)):
                    brighter += gray[row, column] > gray[y, x]
                    seen += 1
            out[y, x] = brighter / seen


@numba.njit(nogil=True)
def direct_companion(gray: NDArray[np.uint8], radius: int, out: NDArray[np.float32]) -> None:
    """Count the equal pixels on the eight rays of every pixel, one by one."""
    height, width = gray.shape
    for y in range(height):
        for x in range(width):
            same = seen = 0
            for dy in range(-1, 2):
                for dx in range(-1, 2):
                    for step in range(1, radius + 1):
                        row, column = y + step * dy, x + step * dx
                        if (dy or dx) and 0 <= row < height and 0 <= column < width:
                            same += gray[row, column] == gray[y, x]
                            seen += 1
            out[y, x] = same / max(seen, 1)


def main() -> None:
    """Compare on the left view of Motorcycle, one thread; refuse to compare what is not the same."""
    gray = np.ascontiguousarray(to_gray(open_dataset("motorcycle").scenes[0].load().left))
    out = np.empty(gray.shape, np.float32)
    ratios = [compare("rank 31, times a direct loop", lambda: rank(gray, 31), lambda: direct_rank(gray, 15, out), 20)]
    if not np.array_equal(out, rank(gray, 31)):
        raise SystemExit("rank differs from the direct loop")
    ratios.append(
        compare(
            "companion 61, 8 rays, times a direct loop",
            lambda: companion(gray, 61),
            lambda: direct_companion(gray, 30, out),
            1,
        )
    )
    if not np.array_equal(out, companion(gray, 61)):
        raise SystemExit("companion differs from the direct loop")
    report("transforms", ratios)


if __name__ == "__main__":
    main()
