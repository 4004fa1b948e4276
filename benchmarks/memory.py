"""Peak resident size of a whole run, as the image grows: ``python -m benchmarks.memory``.

Each run is the command line in a fresh process with a cache of its own. The largest image is of 3000 x 2000 px; its
range of disparities is short, since memory depends on it only in tiles and time depends on it most: give --size for
another, and perhaps ``--set costvolume.mode=guided``.
"""

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from typing import Annotated

import typer

from benchmarks.cached_run import ENTRY
from benchmarks.harness import Ratio, as_command, report

SIZES = ((500, 741, 70), (1000, 1500, 8), (2000, 3000, 8))
"""Rows, columns, disparities."""
GIGABYTES = (2.0, 4.0, 4.0)
_MEASURED = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""


def peak(rows: int, columns: int, disparities: int, settings: Sequence[str] = ()) -> float:
    """Return the peak resident size of a run with nothing cached, GB."""
    scene = f"synthetic:train=0,test=1,height={rows},width={columns},disparities={disparities}"
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        command = [sys.executable, "-c", ENTRY, "run", scene, "--cache", folder]
        command += [f"--set={setting}" for setting in settings]
        done = subprocess.run([sys.executable, "-c", _MEASURED, *command], check=True, capture_output=True, text=True)
    kilobytes = int(done.stdout) / (1024 if sys.platform == "darwin" else 1)
    return kilobytes * 1024 / 1e9


def main(
    size: Annotated[list[str] | None, typer.Option(help="ROWSxCOLUMNSxDISPARITIES, instead of the three sizes")] = None,
    setting: Annotated[list[str] | None, typer.Option("--set", help="section.field=value")] = None,
) -> None:
    """Measure each size once: a peak hardly depends on what else the machine does."""
    sizes = [tuple(map(int, each.split("x"))) for each in size] if size else SIZES
    limits = GIGABYTES if not size else [2.0 if rows * columns <= 500 * 741 else 4.0 for rows, columns, _ in sizes]
    report(
        "memory",
        [
            Ratio(
                f"peak of a run, {rows} x {columns} x {count}{''.join(f', {each}' for each in setting or ())}, GB",
                (peak(rows, columns, count, setting or ()),),
                limit,
                at_most=True,
            )
            for (rows, columns, count), limit in zip(sizes, limits, strict=True)
        ],
    )


if __name__ == "__main__":
    as_command(main)
