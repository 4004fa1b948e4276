"""Aggregation against OpenCV's SGBM, and its memory on a large volume: ``python -m benchmarks.aggregation``.

Both sides run on one thread along eight paths. Ours reads a stored volume of 70 disparities; OpenCV computes its costs
from the views, of 80 disparities, since it takes multiples of 16. The large volume is made as it is read, so that the
figure is the stage's own; it is summed in two passes, which hold more.
"""

import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
import zarr
from numpy.typing import NDArray
from zarr.codecs import ZstdCodec

from benchmarks.harness import Ratio, as_command, compare, report
from semidense.cache.entries.arrays import ZSTD_LEVEL
from semidense.stages.disparity.aggregation.stage import compute_aggregated
from semidense.stages.disparity.aggregation.strips import Volume, aggregate
from semidense.stages.disparity.aggregation.winner import winner
from semidense.stages.disparity.declaration import AggregatedParams

SHAPE = (497, 741, 70)
LARGE = (2000, 3000, 281)
CHUNKS = (32, 256, 70)
CELLS_OF_OPENCV = 80
GIGABYTES = 4.0
ROOT = Path(__file__).parents[1]


class Repeated:
    """A volume that repeats its first rows."""

    def __init__(self, shape: tuple[int, int, int]) -> None:
        self.shape = shape
        self._rows = random_costs((32, *shape[1:]))

    def __getitem__(self, rows: slice) -> NDArray[np.float16]:
        """Return some rows."""
        return self._rows[np.arange(rows.start, rows.stop) % len(self._rows)]


def random_costs(shape: tuple[int, int, int]) -> NDArray[np.float16]:
    """Return costs that spread like those of the networks, NaN where the right pixel is outside the image."""
    costs = np.random.default_rng(0).normal(0, 6, shape).astype(np.float16)
    costs[:, np.arange(shape[1])[:, None] < np.arange(shape[2])] = np.nan
    return costs


def random_view(shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """Return a gray view (y, x) of noise."""
    return np.random.default_rng(0).integers(0, 256, shape[:2]).astype(np.uint8)


def sides(volume: Volume, shape: tuple[int, ...]) -> tuple[Any, Any]:
    """Return what is timed: winners by our sums, and OpenCV's."""
    import cv2

    cv2.setNumThreads(1)
    view = random_view(shape)
    matcher = cv2.StereoSGBM.create(0, CELLS_OF_OPENCV, 3, 72, 288, mode=cv2.STEREO_SGBM_MODE_HH)
    params = AggregatedParams()
    return (
        lambda: [winner(strip) for strip in aggregate(volume, view, 0, params)],
        lambda: matcher.compute(view, view),
    )


def peak(rows: int, columns: int, disparities: int) -> float:
    """Return the peak resident size of a process that makes the product ``aggregated``, GB."""
    call = f"import benchmarks.aggregation as one; one.aggregate_large({rows}, {columns}, {disparities})"
    done = subprocess.run([sys.executable, "-c", call], check=True, capture_output=True, text=True, cwd=ROOT)
    return float(done.stdout)


def aggregate_large(rows: int, columns: int, disparities: int) -> None:
    """Make the product of a volume of a size, and print the peak resident size, GB."""
    volume = {"cost": Repeated((rows, columns, disparities)), "d": np.arange(disparities, dtype=np.int16)}
    view = random_view((rows, columns))[..., np.newaxis]
    compute_aggregated(AggregatedParams(passes=2), {"images": {"left": view}, "costvolume": volume})
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024 if sys.platform == "darwin" else 1)
    print(kilobytes * 1024 / 1e9)


def main(shrink: Annotated[int, typer.Option(min=1, help="Divide the sides of both images by this.")] = 1) -> None:
    """Measure both: the speed in pairs, the peak once, since it hardly depends on what else the machine does."""
    shape = SHAPE[0] // shrink, SHAPE[1] // shrink, SHAPE[2]
    large = LARGE[0] // shrink, LARGE[1] // shrink, LARGE[2]
    with tempfile.TemporaryDirectory() as folder:
        codec = ZstdCodec(level=ZSTD_LEVEL, checksum=True)
        stored = zarr.create_array(folder, shape=shape, chunks=CHUNKS, dtype="float16", compressors=(codec,))
        stored[...] = random_costs(shape)
        ratios = [compare("aggregation and winner, 8 paths, against OpenCV SGBM", *sides(stored, shape), 1.0)]
    what = "peak of aggregation in two passes, {} x {} x {}, GB".format(*large)
    report("aggregation", [*ratios, Ratio(what, (peak(*large),), GIGABYTES, at_most=True)])


if __name__ == "__main__":
    as_command(main)
