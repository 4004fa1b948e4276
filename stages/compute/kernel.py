"""The one way this package compiles a loop."""

import ast
import hashlib
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
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
    """Return a module's source and the modules that it imports from."""
    file = sys.modules[module].__file__
    source = Path(file).read_bytes() if file else b""
    return source, tuple(name for node in _statements(ast.parse(source)) for name in _imported(node))


def _statements(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield all of a tree but its expressions, which import nothing and are most of it."""
    for node in ast.iter_child_nodes(tree):
        if not isinstance(node, ast.expr):
            yield node
            yield from _statements(node)


def _imported(node: ast.AST) -> list[str]:
    """Return the dotted names that a statement may import modules by; a name that is no module is harmless."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom) and node.module:
        return [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return []
