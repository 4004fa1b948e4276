from collections.abc import Iterator
from pathlib import Path

import pytest
import torch

from semidense.stages.compute import precision
from semidense.stages.compute.precision import autocast, cpu_facts, cpu_flags, fast_bfloat16, resolve


@pytest.fixture(autouse=True)
def _asked_again() -> Iterator[None]:
    for known in (cpu_facts, cpu_flags):
        known.cache_clear()
    yield
    for known in (cpu_facts, cpu_flags):
        known.cache_clear()


@pytest.mark.parametrize(
    ("cpuinfo", "plain", "transformed"),
    [
        pytest.param("flags\t\t: fpu avx512f avx512_bf16 amx_tile\n", True, False, id="AVX512-BF16"),
        pytest.param("processor: 0\nflags : amx_bf16 amx_tile\n", True, True, id="AMX"),
        pytest.param("flags : avx2 avx512f\n", False, False, id="neither"),
        pytest.param("flags : avx512_bf16x noamx_bf16\n", False, False, id="a flag is a whole word"),
        pytest.param("model name : avx512_bf16\nflags : avx2\n", False, False, id="only the flags count"),
        pytest.param("Features : asimd bf16\n", False, False, id="another architecture"),
        pytest.param(None, False, False, id="no such file"),
    ],
)
def test_auto_is_what_the_cpu_is_fast_at(
    cpuinfo: str | None, plain: bool, transformed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "cpuinfo"
    if cpuinfo is not None:
        file.write_text(cpuinfo)
    monkeypatch.setattr(precision, "_CPUINFO", file)
    assert (fast_bfloat16(), fast_bfloat16(transformed=True)) == (plain, transformed)
    assert resolve("auto") == ("bfloat16" if plain else "float32")
    assert resolve("auto", transformed=True) == ("bfloat16" if transformed else "float32")


@pytest.mark.parametrize("fast", [False, True])
def test_what_is_asked_for_is_what_one_gets(fast: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(precision, "fast_bfloat16", lambda **_: fast)
    assert resolve("float32") == "float32" and resolve("bfloat16") == "bfloat16"


@pytest.mark.parametrize(
    ("asked", "fast", "dtype"),
    [
        ("float32", True, torch.float32),
        ("bfloat16", False, torch.bfloat16),
        ("auto", True, torch.bfloat16),
        ("auto", False, torch.float32),
    ],
)
def test_products_inside_the_context_have_its_precision(
    asked: precision.Precision, fast: bool, dtype: torch.dtype, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(precision, "fast_bfloat16", lambda **_: fast)
    with autocast(asked):
        assert (torch.ones(2, 2) @ torch.ones(2, 2)).dtype == dtype
    assert (torch.ones(2, 2) @ torch.ones(2, 2)).dtype == torch.float32


def test_threads_share_no_cast_weights() -> None:
    """Else two shards of a step would race for a cast, and a training could end in other bits."""
    with autocast("bfloat16"):
        assert not torch.is_autocast_cache_enabled()
