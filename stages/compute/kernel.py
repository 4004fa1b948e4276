"""The one way this package compiles a loop."""

import hashlib
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import CodeType
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
    name = function.__qualname__
    # Numba names the file on disk by this, and compiles anew when the function's own module has changed. The digest
    # makes it so for the modules that its helpers and constants come from.
    function.__qualname__ = f"{name}-{_digest(function.__module__)}"
    try:
        compiled = numba.njit(cache=True, nogil=True)(function)
    finally:
        function.__qualname__ = name
    return cast(Function, compiled)


def inlined(function: Function) -> Function:
    """Compile a function into each kernel that calls it; called from Python it stays what it is."""
    made: Function = register_jitable(inline="always")(function)
    return made


def _digest(module: str) -> str:
    """Return a digest of the sources of a module and of all that it imports from its top-level package or this one."""
    packages = {module.split(".")[0], __name__.split(".")[0]}
    found: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in found and name in sys.modules:
            found.add(name)
            waiting += (each for each in _source(name)[1] if each.split(".")[0] in packages)
    return hashlib.sha256(b"".join(_source(name)[0] for name in sorted(found))).hexdigest()[:16]


@cache
def _source(module: str) -> tuple[bytes, tuple[str, ...]]:
    """Return a module's source, and those of the imported modules that it names.

    The names are read off its compiled code. A syntax tree would be in danger: Python 3.11 fails now and then when two
    threads make one at the same time, and stages are imported in several threads.
    """
    file = sys.modules[module].__file__
    source = Path(file).read_bytes() if file else b""
    names = set(_names(compile(source, file or "", "exec", dont_inherit=True)))
    modules = names & sys.modules.keys()
    inside = {f"{package}.{name}" for package in modules for name in names} & sys.modules.keys()
    return source, (*modules, *inside)


def _names(code: CodeType) -> Iterator[str]:
    """Yield the names that a code uses, dotted ones as they are imported."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)
