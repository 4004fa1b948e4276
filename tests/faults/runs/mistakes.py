"""Rows 20 to 22: what is no plain file, mistakes on the command line, and numbers of absurd size."""

import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from semidense.cache import Store
from semidense.datasets.exact_files import file_digest
from semidense.datasets.formats.calibration.middlebury import read_calib
from semidense.datasets.formats.images import read_image
from semidense.datasets.formats.pfm import read_pfm
from semidense.pipeline import api
from semidense.pipeline.api import Task
from semidense.pipeline.plan.config import Config
from tests.faults import world
from tests.faults.inputs import CALIB, expect_one_line
from tests.faults.runs.changes import scene_folder
from tests.faults.tally import Tally
from tests.tiny import TEST_ONLY

DIGITS = "9" * 5000
SECONDS = 300.0
"""After this time a command is taken to hang."""
COMMANDS = (
    "{run} status {spec} > /dev/full",
    "{run} status {spec} >&-",
    "{run} status {spec} --set costvolume.d_max={digits}",
    "{run} status {spec} --config /dev/zero",
    "{run} status {spec} --config {pipe}",
    "{run} status middlebury:/proc",
    "{run} status {spec} --cache ftp://bucket/x",
    "{run} run {spec} --upto images --scheduler tcp://127.0.0.1:9",
    "{run} --help > /dev/full",
    "{run} status {spec} --json > /dev/full",
    "{run} sweep {spec} --R {digits}",
    "{run} sweep {spec} --R 1e999",
    "{run} run {spec} --upto images --workers {digits}",
    "{run} match {pipe} {pipe} -o {folder}",
    "{run} status {spec} --cache /proc",
    "ulimit -v 600000; {run} run {spec} --upto disparity",
    "ulimit -n 8; {run} run {spec} --upto images",
)
"""Commands that must end with one line and exit code 2."""


def pipes(scale: float) -> Tally:
    """Put a pipe, a device, a folder or a link to nothing where a file is read."""
    tally = Tally()
    with world.folder() as root:
        pipe, loop = root.parent / "pipe", root.parent / "loop"
        os.mkfifo(pipe)
        loop.symlink_to(loop)
        readers: tuple[Callable[[Path], object], ...] = (read_calib, read_image, read_pfm, file_digest, Config.load)
        for path in (pipe, Path("/dev/zero"), root.parent, loop):
            for read in readers:
                expect_one_line(tally, f"{path.name} as {read.__name__}", lambda r=read, p=path: r(p))
        _in_the_cache(tally, Store(root), pipe)
    return tally


def _in_the_cache(tally: Tally, store: Store, pipe: Path) -> None:
    """Put a pipe in the place of a lock and of a lease: nobody waits for it."""
    made = world.run(store, world.small())
    key = next(iter(made.values())).key
    for place in (
        store.layout.lock("commit", key),
        store.layout.lock("making", key),
        store.layout.leases / ("0f" * 16),
    ):
        os.mkfifo(place)
        tally.injected += 1
        world.run(store, world.small())
        for path in world.leftovers(store):
            tally.fail("leftovers", f"a pipe as {place.name}: {path}")


def commands(scale: float) -> Tally:
    """Run commands that cannot do what they are asked for."""
    tally = Tally()
    run = f"{sys.executable} -m semidense.pipeline"
    with world.folder() as root:
        pipe = root.parent / "pipe"
        os.mkfifo(pipe)
        chosen = COMMANDS[: max(1, int(len(COMMANDS) * scale))]
        places = {"spec": TEST_ONLY, "digits": DIGITS, "pipe": pipe, "folder": root.parent / "out", "run": run}
        tally.injected += len(chosen)
        with ThreadPoolExecutor(2) as pool:  # most of the time they load modules, or wait
            list(pool.map(lambda each: _expect_one_line_and_2(tally, each, each.format(**places), root), chosen))
        tally.injected += 1
        closed = subprocess.run(
            ["/bin/sh", "-c", f"{run} run {TEST_ONLY} --upto images 2>&-"],
            env={**os.environ, "PIPELINE_CACHE": str(root)},
            stdout=subprocess.PIPE,
            timeout=SECONDS,
            check=False,
        )
        if closed.returncode != 0 or b"images" not in closed.stdout:
            tally.fail("tracebacks", f"standard error closed: exit {closed.returncode}")
    return tally


def _expect_one_line_and_2(tally: Tally, what: str, command: str, cache: Path) -> None:
    environment = {**os.environ, "PIPELINE_CACHE": str(cache)}
    try:
        done = subprocess.run(
            ["/bin/sh", "-c", command], env=environment, capture_output=True, text=True, timeout=SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        tally.fail("tracebacks", f"{what}: hangs")
        return
    told = [line for line in done.stderr.splitlines() if line.startswith("pipeline: ")]
    if done.returncode != 2 or len(told) != 1 or "Traceback" in done.stderr:
        tally.fail("tracebacks", f"{what}: exit {done.returncode}: {done.stderr[-200:]}")


def absurd_ranges(scale: float) -> Tally:
    """Claim absurd numbers of disparities in a calibration: what is searched is what the image can have."""
    tally = Tally()
    for number, count in enumerate((49, 1000, 10**9, 10**15)):
        with world.folder() as root:
            calib = CALIB.replace(b"ndisp=4", f"ndisp={count}".encode())
            task = Task(f"middlebury:{scene_folder(root.parent / f'scene{number}', calib)}", cache=root)
            tally.injected += 1
            steps = {each.step.product: each.step for each in api.status(task, "costvolume").steps}
            if steps["costvolume"].settings["d_max"] != 47:
                tally.fail("wrong", f"ndisp={count}: d_max is {steps['costvolume'].settings['d_max']} of 48 columns")
    return tally
