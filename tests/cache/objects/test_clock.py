"""The store's clock goes on whatever happens to this machine's."""

import time

import pytest

from semidense.cache.objects.clock import Clock
from semidense.cache.objects.requests import connect


def test_it_goes_on_with_the_counter_of_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(store=1000.0, counter=5.0, wall=77.0)
    monkeypatch.setattr(time, "monotonic", lambda: 8.0)
    monkeypatch.setattr(time, "time", lambda: 80.5)
    assert clock.now() == 1003.0
    assert clock.is_right()


@pytest.mark.parametrize("wall", [30.0, 600.0], ids=["set back", "set on, or asleep meanwhile"])
def test_a_clock_that_was_set_and_a_machine_that_slept_are_noticed(
    monkeypatch: pytest.MonkeyPatch, wall: float
) -> None:
    clock = Clock(store=1000.0, counter=5.0, wall=77.0)
    monkeypatch.setattr(time, "monotonic", lambda: 8.0)
    monkeypatch.setattr(time, "time", lambda: wall)
    assert not clock.is_right()


def test_setting_this_machines_clock_makes_nobody_look_dead(monkeypatch: pytest.MonkeyPatch) -> None:
    objects, real = connect("memory://clock"), time.time
    before = objects.now()
    monkeypatch.setattr(time, "time", lambda: real() + 600)
    assert 0 <= objects.now() - before < 60
