"""The time that `match` takes for a new pair and for each further one: ``python -m benchmarks.own_pairs``.

A command matches one pair of 741 x 500 px and 71 disparities, another one the same and two more, each in an empty
cache, files and pictures included. The difference is what two further pairs take: in processor time, which other work
on the machine changes little. Loops are compiled beforehand.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from PIL import Image
from skimage.data import stereo_motorcycle

from benchmarks.cached_run import ENTRY
from benchmarks.harness import Ratio, report

View = NDArray[np.uint8]
FURTHER = 2
TARGET = 4.0


def write_pairs(folder: Path, shrink: int) -> None:
    """Write three pairs: Motorcycle, the same upside down, and mirrored with the views exchanged."""
    left, right = (np.asarray(view)[: 500 // shrink, : 741 // shrink] for view in stereo_motorcycle()[:2])
    pairs = [(left, right), (left[::-1], right[::-1]), (right[:, ::-1], left[:, ::-1])]
    for name, views in zip("abc", pairs, strict=True):
        for side, view in zip(("left", "right"), views, strict=True):
            (folder / side).mkdir(exist_ok=True)
            Image.fromarray(np.ascontiguousarray(view)).save(folder / side / f"{name}.png")


def seconds_of(folder: Path, scenes: str) -> tuple[float, float]:
    """Return the wall time and the processor time of a command that matches pairs of a folder, named by a letter."""
    with tempfile.TemporaryDirectory() as scratch:
        sides = [str(folder / side) for side in ("left", "right")]
        options = ["--min-disp", "0", "--max-disp", "70", "--cache", f"{scratch}/cache", "-o", f"{scratch}/out"]
        chosen = [option for scene in scenes for option in ("--scene", scene)]
        begun, before = time.perf_counter(), os.times()
        subprocess.run(
            [sys.executable, "-c", ENTRY, "match", *sides, *options, *chosen], check=True, capture_output=True
        )
        after = os.times()
        used = after.children_user + after.children_system - before.children_user - before.children_system
        return time.perf_counter() - begun, used


def main(
    shrink: Annotated[int, typer.Option(min=1, help="Divide the sides of the views by this.")] = 1,
    times: Annotated[int, typer.Option(min=1, help="How often both commands are timed.")] = 3,
) -> None:
    """Time both commands in turn."""
    with tempfile.TemporaryDirectory() as name:
        write_pairs(Path(name), shrink)
        seconds_of(Path(name), "a")  # to warm up
        runs = [(seconds_of(Path(name), "a"), seconds_of(Path(name), "abc")) for _ in range(times)]
    used = tuple((three[1] - one[1]) / FURTHER for one, three in runs)
    seconds = median(one[0] for one, _ in runs), median(three[0] for _, three in runs)
    what = "each further pair, processor seconds (4 are 2 s on two cores; remark: one pair, three)"
    report("own_pairs", [Ratio(what, used, TARGET, at_most=True, seconds=seconds)])


if __name__ == "__main__":
    typer.run(main)
