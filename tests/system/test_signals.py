"""A run that is told to stop leaves no drafts, and what it had made is found again."""

import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from semidense.pipeline.api import Task, run, status
from semidense.pipeline.execution.watch import Unwatched
from semidense.pipeline.plan.steps import Step
from tests.tiny import SETTINGS, SPEC, options

Start = Callable[..., "subprocess.Popen[str]"]
LONG = ("matching_net.steps=100000", "matching_net.checkpoint_steps=1")


def wait_for(there: Callable[[], bool], process: "subprocess.Popen[str]", seconds: float = 90) -> None:
    end = time.monotonic() + seconds
    while not there():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end, "it did not come so far in time"
        time.sleep(0.02)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_in_the_middle_of_a_stage(start: Start, own_cache: Path, number: signal.Signals, code: int) -> None:
    process = start("run", SPEC, "--train", *options(*LONG), "--cache", own_cache)
    wait_for(lambda: any((own_cache / "checkpoints").glob("[0-9a-f]*")), process)
    assert list((own_cache / "drafts").iterdir())
    process.send_signal(number)
    out, err = process.communicate(timeout=10)
    assert (process.returncode, out) == (code, "")
    assert "Traceback" not in err
    assert list((own_cache / "drafts").iterdir()) == []
    plan = status(Task(SPEC, settings=(*SETTINGS, *LONG), train=True, cache=own_cache))
    made = {planned.step.product for planned in plan.steps if planned.state == "hit"}
    assert made - {"distinctiveness"} == {  # it needs the images alone: before the training, or after
        "images", "truth", "channels", "matching_samples",
    }  # fmt: skip


def test_training_that_was_killed_goes_on_and_comes_out_the_same(start: Start, own_cache: Path, tmp_path: Path) -> None:
    """A checkpoint after each step: the second run starts from the last."""
    other = shutil.copytree(own_cache, tmp_path / "other")
    more = ("matching_net.checkpoint_steps=1", "matching_net.steps=16")
    process = start("run", SPEC, "--train", *options(*more), "--upto", "matching_net", "--cache", own_cache)
    wait_for(lambda: any((own_cache / "checkpoints").glob("[0-9a-f]*")), process)
    process.kill()
    process.communicate()
    assert [path.stat().st_size > 1000 for path in (own_cache / "checkpoints").glob("[0-9a-f]*")] == [True]
    notes = Notes()
    resumed, undisturbed = (
        run(Task(SPEC, settings=(*SETTINGS, *more), train=True, cache=cache), "matching_net", watch=notes)
        for cache in (own_cache, other)
    )
    assert resumed.find("matching_net").digest == undisturbed.find("matching_net").digest
    first = notes.steps.index(16) + 1
    assert notes.steps[first:] == list(range(1, 17)), "from the start"
    assert notes.steps[0] > 1, "from a checkpoint"
    for folder in ("checkpoints", "drafts"):
        assert list((own_cache / folder).iterdir()) == [], "what the dead left is swept"


class Notes(Unwatched):
    """The training steps that were taken."""

    def __init__(self) -> None:
        self.steps: list[int] = []

    def advanced(self, step: Step, done: int, total: int, note: str) -> None:
        if note:
            self.steps.append(done)
