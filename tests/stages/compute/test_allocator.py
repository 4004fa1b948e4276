import ctypes
import sys
from types import SimpleNamespace

import pytest

from semidense.cache import code_parts
from semidense.stages.catalog import STAGES
from semidense.stages.compute.allocator import keep_freed_memory

ask = keep_freed_memory.__wrapped__


def library(monkeypatch: pytest.MonkeyPatch, **functions: object) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(ctypes, "CDLL", lambda _: SimpleNamespace(**functions))


def test_tells_the_library_once_what_to_keep(monkeypatch: pytest.MonkeyPatch) -> None:
    told: dict[int, int] = {}

    def mallopt(option: int, value: int) -> int:
        told[option] = value
        return 1

    library(monkeypatch, mallopt=mallopt)
    assert ask() is True
    assert told == {-8: 1, -3: 32 * 2**20, -1: 2**31 - 1}, "one arena, the largest threshold, never trim"


def test_says_when_a_setting_was_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    library(monkeypatch, mallopt=lambda option, _: int(option != -3))
    assert ask() is False


def test_a_library_without_the_function_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    library(monkeypatch)
    assert ask() is False


def test_other_systems_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    library(monkeypatch, mallopt=lambda *_: pytest.fail("nothing is to be called"))
    monkeypatch.setattr(sys, "platform", "darwin")
    assert ask() is False


def test_is_harmless_here() -> None:
    assert keep_freed_memory() == (sys.platform.startswith("linux") and hasattr(ctypes.CDLL(None), "mallopt"))


def test_is_asked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[int] = []
    library(monkeypatch, mallopt=lambda option, _: told.append(option) or 1)
    keep_freed_memory.cache_clear()
    assert keep_freed_memory() and keep_freed_memory()
    keep_freed_memory.cache_clear()  # what was told to the stand-in is no answer of this system
    assert len(told) == 3


@pytest.mark.parametrize("product", sorted(STAGES))
def test_no_stage_asks_for_it(product: str) -> None:
    """It cannot be taken back, and a stage may run in a notebook."""
    assert "semidense.stages.compute.allocator" not in code_parts(STAGES[product].module, ("semidense",))
