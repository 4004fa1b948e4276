"""The syntax tree of a source: what its hash is over, and which of its parts may run."""

import ast
import hashlib
from collections.abc import Iterator
from threading import RLock
from typing import Any, TypeGuard

_PARSING = RLock()


def parsed(text: str | bytes) -> ast.Module:
    """Return a source's syntax tree, made by one thread at a time: Python 3.11 fails now and then when two make one."""
    with _PARSING:
        return ast.parse(text)


def bare_tree(text: str | bytes) -> ast.AST:
    """Return a source's syntax tree without docstrings, all that its hash is over.

    Raises:
        SyntaxError, ValueError: if it is no Python.
    """
    return without_docstrings(parsed(text))


def without_docstrings(tree: ast.AST) -> ast.AST:
    """Return a tree without the statements that are only text; it is changed."""
    bare: ast.AST = _Bare().visit(tree)
    return bare


def source_hash(text: str | bytes) -> str:
    """Return the hash of a source: over its syntax tree without comments, docstrings and positions.

    >>> source_hash("x = 1") == source_hash("x  =  1  # one")
    True

    Raises:
        SyntaxError, ValueError: if it is no Python.
    """
    return tree_hash(bare_tree(text))


def tree_hash(bare: ast.AST) -> str:
    """Return the hash of a tree without docstrings."""
    return hashlib.sha256(ast.dump(bare).encode("utf-8", "surrogatepass")).hexdigest()


class _Bare(ast.NodeTransformer):
    """Drop statements that are only text: docstrings, and the notes under an assignment."""

    def visit(self, node: ast.AST) -> Any:  # noqa: ANN401 - what the other methods return
        """Visit statements alone: no expression holds one, and expressions are most of a tree."""
        return node if isinstance(node, ast.expr) else super().visit(node)

    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        """Drop the statement if it is a text, and look no deeper otherwise."""
        return None if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str) else node


def running(tree: ast.AST, expressions: bool) -> Iterator[ast.AST]:
    """Yield the nodes of a tree that may run: not what is there for type checkers alone.

    Args:
        tree: a module's.
        expressions: with those too, which are most of a tree. No expression holds a statement.
    """
    waiting = list(ast.iter_child_nodes(tree))
    while waiting:
        node = waiting.pop()
        if is_for_checkers(node):
            waiting += node.orelse
        elif expressions or not isinstance(node, ast.expr):
            yield node
            waiting += ast.iter_child_nodes(node)


def is_for_checkers(node: ast.AST) -> TypeGuard[ast.If]:
    """Return whether a statement is ``if TYPE_CHECKING``, which never runs."""
    test = node.test if isinstance(node, ast.If) else None
    return getattr(test, "attr", getattr(test, "id", None)) == "TYPE_CHECKING"


def may_import_by_call(text: bytes) -> bool:
    """Return whether a source may have a ``literal_import``: its text says so, or writes names in other characters."""
    return not text.isascii() or b"import_module" in text or b"__import__" in text


def literal_import(call: ast.Call) -> str | None:
    """Return the name in ``import_module("name")`` or ``__import__("name")``."""
    called = getattr(call.func, "attr", getattr(call.func, "id", None))
    if called not in ("import_module", "__import__") or not call.args or not isinstance(call.args[0], ast.Constant):
        return None
    return call.args[0].value if isinstance(call.args[0].value, str) else None
