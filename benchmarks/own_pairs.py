"""The time that `match` and `score` take for a reader's own pair: ``python -m benchmarks.own_pairs``.

A command matches one pair of 741 x 500 px and 71 disparities, another one the same and two more, each in an empty
cache, files and pictures included. Loops are compiled beforehand.

- The first command stands against Pandora's on the same pair: MC-CNN fast, libSGM, V-fit, median, cross-checking.
  Pandora is installed into an environment of its own, once.
- The difference of the two commands is what two further pairs take: in processor time, which other work on the machine
  changes little, and by the clock, against OpenCV's SGBM on one thread.
- A third command scores SGBM's map of the pair, with both views, in an empty cache.

All are timed in turn.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from PIL import Image
from skimage.data import stereo_motorcycle

from benchmarks.cached_run import ENTRY
from benchmarks.harness import Ratio, as_command, report, timed
from benchmarks.pandora import ENVIRONMENT, PIPELINE, environment
from benchmarks.peers import PeerError
from semidense.datasets.formats.pfm import write_pfm
from semidense.stages.baselines.declaration import SgmParams
from semidense.stages.baselines.sgm import match_semi_global
from semidense.stages.transforms.gray import to_gray

View = NDArray[np.uint8]
LAST = 70
"""Largest disparity that is searched, px; the smallest is 0."""
FURTHER = 2
OF_PANDORA = 0.5
PROCESSOR = 4.0
"""Processor seconds of a further pair: 2 s on two cores."""
TIMES_SGBM = 12.0
"""2 s, where SGBM takes 0.17 s."""
SCORED = 3.0
"""Seconds that scoring a map takes in an empty cache."""
MAP = "sgbm.pfm"


def write_pairs(folder: Path, shrink: int) -> None:
    """Write three pairs: Motorcycle, the same upside down, and mirrored with the views exchanged."""
    left, right = (np.asarray(view)[: 500 // shrink, : 741 // shrink] for view in stereo_motorcycle()[:2])
    pairs = [(left, right), (left[::-1], right[::-1]), (right[:, ::-1], left[:, ::-1])]
    for name, views in zip("abc", pairs, strict=True):
        for side, view in zip(("left", "right"), views, strict=True):
            (folder / side).mkdir(exist_ok=True)
            Image.fromarray(np.ascontiguousarray(view)).save(folder / side / f"{name}.png")


def seconds_of_match(folder: Path, scenes: str) -> tuple[float, float]:
    """Return the wall time and the processor time of matching pairs of a folder, named by a letter."""
    chosen = [option for scene in scenes for option in ("--scene", scene)]
    return seconds_of("match", folder / "left", folder / "right", "--min-disp", 0, "--max-disp", LAST, *chosen)


def seconds_of_score(folder: Path) -> float:
    """Return the wall time of scoring the map of the first pair."""
    return seconds_of("score", folder / "left" / "a.png", folder / MAP, folder / "right" / "a.png")[0]


def seconds_of(*command: object) -> tuple[float, float]:
    """Return the wall time and the processor time of a command in an empty cache."""
    with tempfile.TemporaryDirectory() as scratch:
        given = [*map(str, command), "--cache", f"{scratch}/cache", "-o", f"{scratch}/out"]
        begun, before = time.perf_counter(), os.times()
        subprocess.run([sys.executable, "-c", ENTRY, *given], check=True, capture_output=True)
        after = os.times()
        used = after.children_user + after.children_system - before.children_user - before.children_system
        return time.perf_counter() - begun, used


def sgbm_of(folder: Path) -> Callable[[], NDArray[np.float32]]:
    """Return what matches the first pair by OpenCV's SGBM, along eight paths, on one thread."""
    import cv2

    cv2.setNumThreads(1)
    left, right = (to_gray(np.asarray(Image.open(folder / side / "a.png"))) for side in ("left", "right"))
    params = SgmParams(d_min=0, d_max=LAST)
    return lambda: match_semi_global(left, right, params, checked=True)


def seconds_of_sgbm(folder: Path) -> float:
    """Return the wall time of SGBM on the first pair."""
    sgbm = sgbm_of(folder)
    return min(timed(sgbm) for _ in range(3))


def seconds_of_pandora(python: Path, folder: Path) -> float:
    """Return the wall time of Pandora's command on the first pair.

    Raises:
        PeerError: if it does not run.
    """
    views: dict[str, object] = {}
    for side, disparities in (("left", [-LAST, 0]), ("right", [0, LAST])):
        gray = folder / f"{side}.png"
        Image.open(folder / side / "a.png").convert("L").save(gray)
        views[side] = {"img": str(gray), "disp": disparities, "nodata": -9999}
    settings = folder / "pandora.json"
    settings.write_text(json.dumps({"input": views, "pipeline": PIPELINE}))
    begun = time.perf_counter()
    done = subprocess.run([python.with_name("pandora"), settings, folder / "pandora"], capture_output=True, text=True)
    if done.returncode:
        raise PeerError(f"Pandora fails: {(done.stderr.strip() or 'no word').splitlines()[-1]}")
    return time.perf_counter() - begun


def against_pandora(folder: Path, times: int) -> list[Ratio]:
    """Return our wall time over Pandora's; where that cannot be had, say so and return none."""
    try:
        python = environment(ENVIRONMENT.absolute())
        seconds_of_pandora(python, folder)  # to warm up
        runs = [(seconds_of_match(folder, "a")[0], seconds_of_pandora(python, folder)) for _ in range(times)]
    except PeerError as error:
        print(error, file=sys.stderr)
        return []
    seconds = median(ours for ours, _ in runs), median(theirs for _, theirs in runs)
    what = "one pair, cold, wall time, times that of Pandora"
    return [Ratio(what, tuple(ours / theirs for ours, theirs in runs), OF_PANDORA, at_most=True, seconds=seconds)]


def of_further_pairs(folder: Path, times: int) -> list[Ratio]:
    """Return the processor time of each further pair, seconds, and its wall time over that of SGBM."""
    runs = [
        (seconds_of_match(folder, "a"), seconds_of_match(folder, "abc"), seconds_of_sgbm(folder)) for _ in range(times)
    ]
    wall, used = (tuple((three[k] - one[k]) / FURTHER for one, three, _ in runs) for k in range(2))
    ratios = tuple(ours / sgbm for ours, (_, _, sgbm) in zip(wall, runs, strict=True))
    both = median(wall), median(sgbm for _, _, sgbm in runs)
    return [
        Ratio("each further pair, processor seconds", used, PROCESSOR, at_most=True),
        Ratio(
            "each further pair, wall time, times that of OpenCV SGBM", ratios, TIMES_SGBM, at_most=True, seconds=both
        ),
    ]


def of_score(folder: Path, times: int) -> Ratio:
    """Return the seconds of scoring SGBM's map."""
    write_pfm(folder / MAP, sgbm_of(folder)())
    taken = tuple(seconds_of_score(folder) for _ in range(times))
    return Ratio("scoring a map, cold, seconds", taken, SCORED, at_most=True)


def main(
    shrink: Annotated[int, typer.Option(min=1, help="Divide the sides of the views by this.")] = 1,
    times: Annotated[int, typer.Option(min=1, help="How often each command is timed.")] = 3,
    install: Annotated[bool, typer.Option(help="Install Pandora and measure against it.")] = True,
) -> None:
    """Time the commands in turn."""
    with tempfile.TemporaryDirectory() as name:
        write_pairs(Path(name), shrink)
        seconds_of_match(Path(name), "a")  # to warm up
        ratios = against_pandora(Path(name), times) if install else []
        report("own_pairs", [*ratios, *of_further_pairs(Path(name), times), of_score(Path(name), times)])


if __name__ == "__main__":
    as_command(main)
