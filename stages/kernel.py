"""The one way this package compiles a loop."""

from collections.abc import Callable
from typing import TypeVar, cast

import numba
from numba.extending import register_jitable

Function = TypeVar("Function", bound=Callable[..., object])


def kernel(function: Function) -> Function:
    """Compile a loop over arrays to machine code.

    It is compiled at its first call and kept on disk, and it runs without the interpreter's lock, so that
    tiles run side by side in threads. Floating point keeps IEEE rules (NaN compares as false), and nothing
    checks an index: the public function around a kernel checks what it is given.
    """
    return cast(Function, numba.njit(cache=True, nogil=True)(function))


def inlined(function: Function) -> Function:
    """Compile a function into each kernel that calls it; called from Python it stays what it is."""
    made: Function = register_jitable(inline="always")(function)
    return made
