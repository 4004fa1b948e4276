"""Which arithmetic the networks use, and whether this CPU is fast at it. Imports torch only to compute."""

from contextlib import AbstractContextManager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import torch

Precision = Literal["auto", "float32", "bfloat16"]
"""``auto`` becomes one of the other two before anything is computed, and it is that one that enters the key."""
_MATRIX_UNITS = frozenset({"amx_bf16"})
_INSTRUCTIONS = frozenset({"avx512_bf16"})
_CPUINFO = Path("/proc/cpuinfo")


@cache
def cpu_facts() -> dict[str, str]:
    """Return what Linux says of this machine's first CPU, by field; nothing where it does not say."""
    if not _CPUINFO.exists():
        return {}
    lines = (line.partition(":") for line in reversed(_CPUINFO.read_text().splitlines()))
    return {name.strip(): value.strip() for name, _, value in lines}


@cache
def cpu_flags() -> frozenset[str]:
    """Return what Linux says that this CPU can do; nothing where it does not say."""
    facts = cpu_facts()
    return frozenset((facts.get("flags") or facts.get("Features", "")).split())


def fast_bfloat16(*, transformed: bool = False) -> bool:
    """Return whether this CPU is faster in bfloat16 than in float32; False where it cannot be told.

    Args:
        transformed: of convolutions that run in a transformed domain in float32 alone. With a third of the products
            they are as fast as plain ones with AVX512-BF16, or faster; matrix units (AMX) alone outrun them.
    """
    fast = _MATRIX_UNITS if transformed else _MATRIX_UNITS | _INSTRUCTIONS
    return not fast.isdisjoint(cpu_flags())


def resolve(precision: Precision, *, transformed: bool = False) -> Literal["float32", "bfloat16"]:
    """Return the precision that ``auto`` stands for on this CPU; the others stand for themselves."""
    if precision == "auto":
        return "bfloat16" if fast_bfloat16(transformed=transformed) else "float32"
    return precision


def dtype_of(precision: Precision) -> "torch.dtype":
    """Return the dtype of what is multiplied in a precision."""
    import torch

    return torch.bfloat16 if resolve(precision) == "bfloat16" else torch.float32


def autocast(precision: Precision) -> AbstractContextManager[None]:
    """Return the context in which convolutions run in ``precision`` (per thread, as torch has it).

    Without torch's cache of cast weights: threads share it, and a shard's gradient would take another shard's path.
    """
    import torch

    context: AbstractContextManager[None] = torch.autocast(
        "cpu", dtype=torch.bfloat16, enabled=resolve(precision) == "bfloat16", cache_enabled=False
    )
    return context
