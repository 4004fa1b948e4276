"""Which arithmetic the networks use, and whether this CPU is fast at it. Imports torch only to compute."""

from contextlib import AbstractContextManager
from functools import cache
from pathlib import Path
from typing import Literal

Precision = Literal["auto", "float32", "bfloat16"]
"""``auto`` becomes one of the other two before anything is computed, and it is that one that enters the key."""
_FAST_FLAGS = {"amx_bf16", "avx512_bf16"}
_CPUINFO = Path("/proc/cpuinfo")


@cache
def fast_bfloat16() -> bool:
    """Return whether this CPU multiplies bfloat16 in hardware (AMX or AVX512-BF16); False where it cannot be told."""
    if not _CPUINFO.exists():
        return False
    return any(
        _FAST_FLAGS & set(line.split()) for line in _CPUINFO.read_text().splitlines() if line.startswith("flags")
    )


def resolve(precision: Precision) -> Literal["float32", "bfloat16"]:
    """Return the precision that ``auto`` stands for on this CPU; the others stand for themselves."""
    if precision == "auto":
        return "bfloat16" if fast_bfloat16() else "float32"
    return precision


def autocast(precision: Precision) -> AbstractContextManager[None]:
    """Return the context in which convolutions run in ``precision`` (per thread, as torch has it)."""
    import torch

    context: AbstractContextManager[None] = torch.autocast(
        "cpu", dtype=torch.bfloat16, enabled=resolve(precision) == "bfloat16"
    )
    return context
