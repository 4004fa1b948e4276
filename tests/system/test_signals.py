"""A run that is told to stop leaves no drafts, and what it had made is found again."""

import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.api import Result, Task, status
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
    assert {planned.step.product for planned in plan.steps if planned.state == "hit"} == {
        "images", "truth", "channels", "matching_samples",
    }  # fmt: skip


def test_training_that_was_killed_goes_on_and_comes_out_the_same(start: Start, tmp_path: Path, trained: Result) -> None:
    """A checkpoint after each step: the second run starts from the last."""
    cache = tmp_path / "cache"
    more = ("matching_net.checkpoint_steps=1", "matching_net.steps=16")
    arguments = ("run", SPEC, "--train", *options(*more), "--upto", "matching_net", "--cache", cache)
    process = start(*arguments)
    wait_for(lambda: any((cache / "checkpoints").glob("[0-9a-f]*")), process)
    process.kill()
    process.communicate()
    (checkpoint,) = (cache / "checkpoints").glob("[0-9a-f]*")
    assert checkpoint.stat().st_size > 1000
    resumed = start(*arguments)
    resumed.communicate(timeout=120)
    assert resumed.returncode == 0
    assert not list((cache / "checkpoints").glob("[0-9a-f]*"))
    assert not list((cache / "drafts").iterdir()), "the drafts of the dead are swept"
    undisturbed = start(*arguments[:-1], tmp_path / "other")
    undisturbed.communicate(timeout=120)
    task = Task(SPEC, settings=(*SETTINGS, *more), train=True)
    plans = [status(Task(task.dataset, settings=task.settings, train=True, cache=root), "matching_net")
             for root in (cache, tmp_path / "other")]  # fmt: skip
    assert plans[0].todo() == plans[1].todo() == ()
    assert [planned.digest for planned in plans[0].steps] == [planned.digest for planned in plans[1].steps]
