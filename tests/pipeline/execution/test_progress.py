import io
import sys
from dataclasses import replace
from typing import Any

import numba
import pytest
from rich.console import Console

from semidense.pipeline.execution import progress
from semidense.pipeline.execution.progress import ProgressWatch
from semidense.pipeline.plan.plan import Made, Plan, Planned
from tests.pipeline.toy import RAMP, SUM, step

NO_STORE: Any = None
TILED, TRAINED = step(RAMP, 0), step(replace(SUM, monitored=True))


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A clock to set."""
    clock = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    return clock


def test_without_a_terminal_nothing_is_said_of_quick_work(capsys: pytest.CaptureFixture[str], now: list[float]) -> None:
    with ProgressWatch() as watch:
        watch.begun(TILED, 2)
        watch.advanced(TILED, 1, 2, "")
        watch.published(Made(TILED, "k", "d", 0.5, False))
    assert capsys.readouterr() == ("", "")


def test_compiling_is_told_once(capsys: pytest.CaptureFixture[str], now: list[float]) -> None:
    with ProgressWatch() as watch:
        watch.begun(TILED, 2)
        watch.begun(TRAINED, 1)
        for factor in (2, 3):
            assert numba.njit(lambda x, factor=factor: factor * x)(5) == 5 * factor
    assert numba.njit(lambda x: 4 * x)(5) == 20, "after the end nothing is said"
    assert capsys.readouterr().err.splitlines() == ["compiling loops, once a machine: later runs begin at once"]


def test_without_a_terminal_long_work_says_a_line_now_and_then(
    capsys: pytest.CaptureFixture[str], now: list[float]
) -> None:
    with ProgressWatch() as watch:
        watch.begun(TRAINED, 1)
        for done in range(1, 101):
            now[0] = done * 1.0
            watch.advanced(TRAINED, done, 100, f"loss {1 / done:.2f}")
        watch.published(Made(TRAINED, "k", "d", 100.0, False))
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == [
        "sum of Toy: 20 of 100, about 80 s left loss 0.05",
        "sum of Toy: 40 of 100, about 60 s left loss 0.03",
        "sum of Toy: 60 of 100, about 40 s left loss 0.02",
        "sum of Toy: 80 of 100, about 20 s left loss 0.01",
        "made sum of Toy in 100.0 s",
    ]


def test_steps_of_a_checkpoint_took_no_time(capsys: pytest.CaptureFixture[str], now: list[float]) -> None:
    with ProgressWatch() as watch:
        watch.begun(TRAINED, 1)
        for done in range(61, 101):
            now[0] = (done - 60) * 1.0
            watch.advanced(TRAINED, done, 100, "")
    assert capsys.readouterr().err == "sum of Toy: 80 of 100, about 20 s left\n"


def test_tiles_add_up(capsys: pytest.CaptureFixture[str], now: list[float]) -> None:
    with ProgressWatch() as watch:
        watch.begun(TILED, 4)
        watch.advanced(TILED, 1, 4, "")
        now[0] = 30.0
        watch.advanced(TILED, 1, 4, "")
    assert capsys.readouterr().err == "ramp of Toy: 2 of 4, about 30 s left\n"


def test_what_was_there_is_not_announced(capsys: pytest.CaptureFixture[str]) -> None:
    with ProgressWatch() as watch:
        watch.published(Made(TILED, "k", "d", 100.0, True))
    assert capsys.readouterr() == ("", "")


def test_a_step_that_was_never_begun_is_ignored(capsys: pytest.CaptureFixture[str], now: list[float]) -> None:
    with ProgressWatch() as watch:
        now[0] = 30.0
        watch.advanced(TILED, 1, 2, "")
    assert capsys.readouterr() == ("", "")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


PLAN = Plan((Planned(TILED, "missing"), Planned(TRAINED, "missing")), ())


def test_on_a_terminal_there_is_one_bar_for_the_whole_run(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    watch = ProgressWatch()
    watch._console = watch._bar.live.console = Console(file=terminal, force_terminal=True, width=120)
    with watch:
        watch.planned(PLAN, NO_STORE)
        watch.begun(TILED, 2)
        watch.published(Made(TILED, "k", "d", 0.5, False))
        watch.begun(TRAINED, 1)
        watch.advanced(TRAINED, 3, 10, "loss 0.25")
        watch._bar.refresh()
        (whole,) = watch._bar.tasks
        watch.published(Made(TRAINED, "k", "d", 2.0, False))
    shown = terminal.getvalue()
    assert "1/2" in shown
    assert "sum of Toy 3/10 loss 0.25" in shown
    assert "made sum of Toy in 2.0 s" in shown
    assert (whole.completed, whole.total) == (2, 2)


def test_parts_of_a_product_move_the_bar() -> None:
    with ProgressWatch() as watch:
        watch.planned(PLAN, NO_STORE)
        watch.begun(TILED, 4)
        watch.advanced(TILED, 1, 4, "")
        assert watch._bar.tasks[0].completed == 0.25


def test_a_run_that_plans_again_begins_its_bar_anew() -> None:
    with ProgressWatch() as watch:
        watch.planned(PLAN, NO_STORE)
        watch.published(Made(TILED, "k", "d", 0.5, False))
        watch.planned(Plan(PLAN.steps[1:], ()), NO_STORE)
        assert (watch._bar.tasks[0].completed, watch._bar.tasks[0].total) == (0, 1)


def test_a_run_is_announced_before_it_begins() -> None:
    told: list[Plan] = []
    with ProgressWatch(lambda plan, _: told.append(plan)) as watch:
        watch.planned(PLAN, NO_STORE)
    assert told == [PLAN]


@pytest.mark.parametrize(
    ("detail", "lines"),
    [
        pytest.param(-1, [], id="quiet"),
        pytest.param(0, ["time: 5 s", "made ramp of Toy in 2.0 s"], id="what takes a second"),
        pytest.param(
            1, ["time: 5 s", "made ramp of Toy in 2.0 s", "made sum of Toy in 0.5 s", "reused sum of Toy"], id="verbose"
        ),
    ],
)
def test_how_much_is_said(capsys: pytest.CaptureFixture[str], detail: int, lines: list[str]) -> None:
    with ProgressWatch(lambda plan, store: sys.stderr.write("time: 5 s\n") and None, detail) as watch:
        watch.planned(Plan((), ()), NO_STORE)
        for tested, seconds, reused in ((TILED, 2.0, False), (TRAINED, 0.5, False), (TRAINED, 9.0, True)):
            watch.published(Made(tested, "k", "d", seconds, reused))
    assert capsys.readouterr().err.splitlines() == lines


def test_runs_that_are_expected_together_are_announced_once(capsys: pytest.CaptureFixture[str]) -> None:
    with ProgressWatch(lambda plan, store: sys.stderr.write(f"{len(plan.todo())}\n") and None) as watch:
        watch.expect(Plan((Planned(TILED, "missing"), Planned(TRAINED, "missing")), ()), NO_STORE)
        watch.planned(Plan((Planned(TILED, "missing"),), ()), NO_STORE)
        watch.planned(Plan((Planned(TRAINED, "missing"),), ()), NO_STORE)
    assert capsys.readouterr().err.splitlines() == ["2"]
