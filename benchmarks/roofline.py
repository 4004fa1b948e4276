"""The cost volume against the machine's own limits, in the same run: ``python -m benchmarks.roofline``.

The limits: the rate of bare convolutions of the network's two large shapes, also with 8-bit integers, and the rate of
bare batched matrix products of the shapes that the transformed convolutions multiply (see
``semidense.stages.matching.winograd.volume``). The stage counts whole: reading the channels from the cache, everything
between, writing and publishing, in the precision that it has on this CPU. All run on one thread.
"""

import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import torch
from torch.nn import functional

from benchmarks.harness import PAIRS, Ratio, report, timed
from semidense.pipeline.api import Task, run
from semidense.stages.compute.precision import dtype_of, fast_bfloat16
from semidense.stages.compute.threads import keep_one_thread
from semidense.stages.matching.cost_volume import valid_columns

HEIGHT, WIDTH, DISPARITIES = 128, 256, 40
SCENE = f"synthetic:train=0,test=1,height={HEIGHT},width={WIDTH},disparities={DISPARITIES}"
DIRECT = 2 * (9 * 384 * 64 + 25 * 64 * 128)
"""Operations of a cell by plain convolutions."""
TRANSFORMED = 2 * (36 * 384 * 64 + 64 * 64 * 128) / 16
"""Operations of a cell in the transformed domain, its products alone."""
TILES = 153
"""4 x 4 tiles of a block of 32 x 64 cells, with those that the hidden layer reaches on."""


def bare_convolutions(dtype: torch.dtype) -> tuple[Callable[[], None], float]:
    """Return both large convolutions on a block, and their operations."""
    wide, narrow = torch.randn(1, 384, 38, 70, dtype=dtype), torch.randn(1, 64, 36, 68, dtype=dtype)
    first, second = torch.randn(64, 384, 3, 3, dtype=dtype), torch.randn(128, 64, 5, 5, dtype=dtype)
    wide, narrow, first, second = (
        each.contiguous(memory_format=torch.channels_last) for each in (wide, narrow, first, second)
    )

    def work() -> None:
        functional.conv2d(wide, first)
        functional.conv2d(narrow, second)

    return work, 2 * (36 * 68 * 9 * 384 * 64 + 32 * 64 * 25 * 64 * 128)


def integer_convolutions() -> tuple[Callable[[], None], float]:
    """Return both large convolutions on a block in 8-bit integers, as torch has them, and their operations."""
    kernels = torch.ops.quantized
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch announces that its integer tensors will change their place
        wide, narrow = (
            torch.quantize_per_tensor(
                torch.rand(shape).contiguous(memory_format=torch.channels_last), 0.01, 0, torch.quint8
            )
            for shape in ((1, 384, 38, 70), (1, 64, 36, 68))
        )
        first, second = (
            kernels.conv2d_prepack(
                torch.quantize_per_tensor(torch.randn(shape), 0.02, 0, torch.qint8), None, [1, 1], [0, 0], [1, 1], 1
            )
            for shape in ((64, 384, 3, 3), (128, 64, 5, 5))
        )

    def work() -> None:
        kernels.conv2d_relu(wide, first, 0.5, 0)
        kernels.conv2d_relu(narrow, second, 0.5, 0)

    return work, 2 * (36 * 68 * 9 * 384 * 64 + 32 * 64 * 25 * 64 * 128)


def bare_products(dtype: torch.dtype) -> tuple[Callable[[], None], float]:
    """Return the batched matrix products of a block, and their operations."""
    joined, features = torch.randn(36, TILES, 128, dtype=dtype), torch.randn(64, TILES, 64, dtype=dtype)
    first, second = torch.randn(36, 128, 64, dtype=dtype), torch.randn(64, 64, 128, dtype=dtype)

    def work() -> None:
        for _ in range(3):  # a product a channel
            torch.bmm(joined, first)
        torch.bmm(features, second)

    return work, 2 * TILES * (3 * 36 * 128 * 64 + 64 * 64 * 128)


def rate(side: tuple[Callable[[], None], float], times: int = 10) -> float:
    """Return operations a second."""
    work, operations = side
    with torch.inference_mode():
        return times * operations / timed(lambda: [work() for _ in range(times)])


def main() -> None:
    """Time stage and limits in turn."""
    keep_one_thread()
    cells = HEIGHT * sum(end - first for first, end in (valid_columns(d, WIDTH) for d in range(DISPARITIES + 1)))
    dtypes = [torch.float32, *([torch.bfloat16] if fast_bfloat16() else [])]
    convolutions = {str(dtype): bare_convolutions(dtype) for dtype in dtypes}
    convolutions["int8"] = integer_convolutions()
    products = bare_products(dtype_of("auto"))
    shares: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        task = Task(SCENE, cache=Path(folder))
        run(task, "costvolume", workers=1)
        for _ in range(PAIRS):
            speed = cells / timed(lambda: run(task, "costvolume", forced=["costvolume"], workers=1))
            for name, side in convolutions.items():
                what = f"share of the bare convolution rate ({name.removeprefix('torch.')})"
                shares.setdefault(what, []).append(speed * DIRECT / rate(side))
            shares.setdefault("share of the bare matrix product rate", []).append(speed * TRANSFORMED / rate(products))
    report("roofline", [Ratio(what, tuple(found), 0.7) for what, found in shares.items()])


if __name__ == "__main__":
    main()
