"""A run in which everything is cached against one that makes everything: ``python -m benchmarks.cached_run``.

Both are commands in processes of their own, export included, so that start-up counts.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.harness import PAIRS, Ratio, report, timed

SCENE = "synthetic:train=0,test=1,height=128,width=256,disparities=24"
ENTRY = "from semidense.pipeline.cli.main import command; command()"


def command(cache: Path, output: Path) -> None:
    """Run the command line; what it prints is dropped."""
    arguments = ["run", SCENE, "--cache", str(cache), "--output", str(output)]
    subprocess.run([sys.executable, "-c", ENTRY, *arguments], check=True, capture_output=True)


def main() -> None:
    """Fill a cache, use it again, and drop it."""
    ratios, seconds = [], []
    for pair in range(PAIRS + 1):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            fresh, cached = (timed(lambda folder=folder: command(folder / "c", folder / "o")) for _ in range(2))  # type: ignore[misc]
        if pair:  # the first is the warm-up
            ratios.append(fresh / cached)
            seconds.append(cached)
    report(
        "cached_run",
        [
            Ratio("cached run, times one that makes everything", tuple(ratios), 1),
            Ratio("cached run with export, seconds", tuple(seconds), 3, at_most=True),
        ],
    )


if __name__ == "__main__":
    main()
