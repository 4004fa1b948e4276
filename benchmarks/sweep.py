"""A sweep of 19 values of R after a run, against the run itself: ``python -m benchmarks.sweep``.

Nineteen full runs would take 19 times as long as one, so the time of one run is measured and multiplied.
"""

import tempfile
from pathlib import Path

from benchmarks.harness import PAIRS, Ratio, report, timed
from semidense.pipeline.api import Task, run, sweep

SCENE = "synthetic:train=0,test=1,height=96,width=128,disparities=16"
VALUES = 19


def main() -> None:
    """Run, then sweep, each time with a fresh cache."""
    ratios, seconds, reused = [], [], True
    for pair in range(PAIRS + 1):
        with tempfile.TemporaryDirectory() as folder:
            task = Task(SCENE, cache=Path(folder))
            whole = timed(lambda task=task: run(task))  # type: ignore[misc]
            found = []
            swept = timed(lambda task=task, found=found: found.append(sweep(task)))  # type: ignore[misc]
        made = {each.step.product for each in found[0].made.values() if not each.reused}
        reused = reused and made <= {"semidense", "metrics"}
        if pair:  # the first is the warm-up
            ratios.append(VALUES * whole / swept)
            seconds.append(swept)
    if not reused:
        raise SystemExit("the sweep made products above semidense again")
    report(
        "sweep",
        [
            Ratio("sweep of 19 R, times 19 full runs", tuple(ratios), 1),
            Ratio("sweep of 19 R after a run, seconds a scene", tuple(seconds), 2, at_most=True),
        ],
    )


if __name__ == "__main__":
    main()
