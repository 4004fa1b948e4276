"""Other people's matchers, each at its own version in a process of its own, asked for the time of their work alone."""

import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

ACCURATE = "mccnn==1.2.5"
"""The last version of MC-CNN that comes with the accurate network."""
_ACCURATE_LOOP = """
import sys, time, warnings
from importlib import resources
import numpy as np
import torch
from mc_cnn.run import run_mc_cnn_accurate
warnings.simplefilter("ignore")
torch.set_num_threads(1)
given = np.load(sys.argv[1])
weights = str(resources.files("mc_cnn") / "weights" / "mc_cnn_accurate_mb_weights.pt")
first, last = map(int, given["disparities"])
print("ready", flush=True)
for _ in sys.stdin:
    start = time.perf_counter()
    with torch.inference_mode():
        run_mc_cnn_accurate(given["left"], given["right"], -last, -first, weights)
    print(time.perf_counter() - start, flush=True)
"""
_RADIUS = 5


class PeerError(RuntimeError):
    """A matcher cannot be installed or does not start."""


def install(requirement: str, folder: Path) -> Path:
    """Put a distribution into a folder of its own, once; the packages that it needs are those of the project.

    Raises:
        PeerError: if pip cannot.
    """
    target = folder / requirement
    if not target.is_dir():
        command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(target), requirement]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise PeerError(
                f"{requirement} cannot be installed: {(done.stderr.strip() or 'pip fails').splitlines()[-1]}"
            )
    return target


class AccurateMatcher:
    """MC-CNN accurate on one pair, one thread; as a context manager, it ends with the block."""

    def __init__(self, left: NDArray[np.uint8], right: NDArray[np.uint8], disparities: range, folder: Path) -> None:
        installed = install(ACCURATE, folder)
        # The package answers where a whole patch lies within the view: continued, the views answer everywhere.
        views = {
            name: np.pad(view, _RADIUS, mode="edge").astype(np.float32)
            for name, view in (("left", left), ("right", right))
        }
        given = folder / "pair.npz"
        np.savez(given, **views, disparities=np.array([disparities[0], disparities[-1]]))  # type: ignore[arg-type]
        self._process = subprocess.Popen(
            [sys.executable, "-c", _ACCURATE_LOOP, str(given)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={"PYTHONPATH": str(installed.resolve()), "PATH": ""},
        )
        self._answer()

    def seconds(self) -> float:
        """Match once and return the time of it."""
        if self._process.stdin is None:
            raise PeerError(f"{ACCURATE} takes no questions")
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return float(self._answer())

    def _answer(self) -> str:
        line = self._process.stdout.readline() if self._process.stdout else ""
        if not line:
            raise PeerError(f"{ACCURATE} does not run here")
        return line

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.wait()
