"""Run the commands that the documents show, in their order, in an empty folder: ``python -m tests.system.commands``.

The folder holds a small rectified pair, ``left.png`` and ``right.png``, and its cache the products of Motorcycle. A
command that cannot run there is named with the reason. The exit code is 1 if a command fails.
"""

import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from PIL import Image
from skimage.data import stereo_motorcycle

from tests.system.test_readme import COMMANDS

NOT_RUN = (
    (r"\bDIR\b", "needs a copy of a benchmark"),
    (r"s3://", "needs an object store: tests/system/test_object_store.py has one"),
    (r"scheduler\.json", "needs a scheduler that runs: tests/system/test_cluster.py starts one"),
    (r"\bview\b", "runs until it is stopped: tests/system/test_viewer_page.py opens it"),
    (r"\bKEY\b", "needs the key of an entry"),
    (r"my_costs", "needs a stage of another package: tests/system/test_extension.py has one"),
    (r"--calib |camera/|shots/|video/|pairs\.csv|rectified/", "needs files of the reader: tests/system/test_match.py"),
    (r"\.pfm|volume\.(npy|zarr)", "needs the result of another matcher: tests/system/test_score.py, test_own_costs.py"),
    (r"a\.toml|matching_net\.safetensors", "needs a file that the reader writes"),
    (r"pipeline compare", "slow: tests/system/test_compare.py compares on a small scene"),
    (r"channels\.rank_window", "slow: makes an exact volume for each new setting"),
    (r"inspect calibration", "needs a training: tests/pipeline/figures/test_figure.py draws one"),
)
"""What a command that is not run has in it, and why it is not run."""
FIRST = ("pipeline run motorcycle --output results",)
"""What is run before all others: the pages show its products, after a run of a benchmark that is not here."""
SECONDS = 1800
"""The longest time that a command may take."""


def reason(line: str) -> str | None:
    """Return why a command is not run; None if it is."""
    return next((why for pattern, why in NOT_RUN if re.search(pattern, line.split(" #")[0])), None)


def run_all(lines: Sequence[str], folder: Path) -> list[str]:
    """Run commands in a folder, print how each ended, and return those that failed."""
    return [line for line in lines if not _passes(line, folder)]


def _passes(line: str, folder: Path) -> bool:
    if why := reason(line):
        print(f"not run  {line}\n         {why}", flush=True)
        return True
    start = time.monotonic()
    ran = subprocess.run(
        [sys.executable, "-m", "semidense.pipeline", *shlex.split(line, comments=True)[1:]],
        cwd=folder,
        env=os.environ | {"PIPELINE_CACHE": str(folder / "cache")},
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    print(f"exit {ran.returncode}   {line} ({time.monotonic() - start:.0f} s)", flush=True)
    print(ran.stderr if ran.returncode else "", end="", flush=True)
    return ran.returncode == 0


def write_pair(folder: Path) -> None:
    """Write a piece of the Motorcycle pair, 120 x 160 px, as ``left.png`` and ``right.png``."""
    left, right, _ = stereo_motorcycle()
    for view, name in ((left, "left.png"), (right, "right.png")):
        Image.fromarray(view[200:320, 300:460]).save(folder / name)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        write_pair(Path(place))
        failed = run_all([*FIRST, *dict.fromkeys(COMMANDS)], Path(place))
    sys.exit(f"{len(failed)} commands failed" if failed else 0)
