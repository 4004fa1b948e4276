"""Keep the texts of the modules that made entries, so that a change of code can be shown by function and line.

A text is kept under the hash of its code and checked against it when it is read, so it needs no other guard;
one that is missing or damaged costs an explanation, never a result.
"""

import ast
import difflib
import os
import secrets
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass

from semidense.cache.errors import CacheError
from semidense.cache.files import make_folder, remove
from semidense.cache.keys.code import module_hash, source_text
from semidense.cache.keys.trees import bare_tree, source_hash
from semidense.cache.layout import Layout

LONGEST = 1 << 20
"""Characters; no module is longer, and what is longer is not read."""


@dataclass(frozen=True)
class SourceChange:
    """The first place in which two versions of a module differ.

    Attributes:
        function: dotted name of the function or class in the module; empty for what stands outside of any.
        line: of the new text, where that function begins; 0 if it is gone.
        old: the first lines that differ, as they were; empty if lines were only added.
        new: as they are.
    """

    function: str
    line: int
    old: str
    new: str


def keep_sources(layout: Layout, code: Mapping[str, str]) -> None:
    """Keep the text of each module of a recipe's code, if it is still the one that was hashed.

    What cannot be kept is left out: only explanations need it.
    """
    with suppress(CacheError):
        layout.create()
    for code_hash, text in source_texts(code, lambda code_hash: layout.source(code_hash).exists()):
        with suppress(CacheError, OSError):
            layout.require_cache()
            path = layout.source(code_hash)
            make_folder(path.parent)
            temporary = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}")
            try:
                temporary.write_text(text, encoding="utf-8")
                temporary.replace(path)
            finally:
                remove(temporary)


def source_texts(code: Mapping[str, str], is_kept: Callable[[str], bool]) -> Iterator[tuple[str, str]]:
    """Yield the hash and the text of each module of a recipe's code that is not kept, and still the one hashed."""
    for module, code_hash in code.items():
        with suppress(CacheError, OSError):
            if is_kept(code_hash) or module_hash(module) != code_hash or (text := source_text(module)) is None:
                continue
            yield code_hash, text


def kept_source(layout: Layout, code_hash: str) -> str | None:
    """Return the text that was kept under a hash; None if there is none, or it is not the one."""
    with suppress(CacheError, OSError):
        path = layout.source(code_hash)
        if path.is_file() and not path.is_symlink() and path.stat().st_size <= LONGEST:
            return verified_source(code_hash, path.read_bytes())
    return None


def verified_source(code_hash: str, data: bytes) -> str | None:
    """Return the text of bytes if their code has this hash; else None."""
    with suppress(CacheError, ValueError, SyntaxError, RecursionError, MemoryError):
        text = data.decode("utf-8")
        return text if len(text) <= LONGEST and source_hash(text) == code_hash else None
    return None


def source_change(old: str, new: str) -> SourceChange | None:
    r"""Return the first function in which two versions of a module differ, None if their code is the same.

    >>> source_change("def f(x):\n    return x > 1\n", "def f(x):\n    return x >= 1\n")
    SourceChange(function='f', line=1, old='return x > 1', new='return x >= 1')
    """
    before, after = dict(_definitions(bare_tree(old))), dict(_definitions(bare_tree(new)))
    for name in [*after, *(name for name in before if name not in after)]:
        was, now = before.get(name, _NOTHING), after.get(name, _NOTHING)
        if was.text != now.text:
            return SourceChange(name, now.line, *_first_difference(was.text, now.text))
    return None


@dataclass(frozen=True)
class _Definition:
    text: str
    line: int


_NOTHING = _Definition("", 0)


def _definitions(tree: ast.AST, prefix: str = "") -> Iterator[tuple[str, _Definition]]:
    """Yield each function, method and class by name, and under the empty name what stands outside of them."""
    outside = []
    for node in getattr(tree, "body", []):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield f"{prefix}{node.name}", _Definition(ast.unparse(node), node.lineno)
        elif isinstance(node, ast.ClassDef):
            yield from _definitions(node, f"{prefix}{node.name}.")
        else:
            outside.append(node)
    head = [ast.unparse(each) for each in (getattr(tree, "bases", []) + getattr(tree, "decorator_list", []))]
    text = "\n".join([*head, *(ast.unparse(node) for node in outside)])
    yield prefix.rstrip("."), _Definition(text, getattr(tree, "lineno", outside[0].lineno if outside else 0))


def _first_difference(old: str, new: str, longest: int = 70) -> tuple[str, str]:
    """Return the first lines that differ, cut to what fits a line."""
    before, after = old.splitlines(), new.splitlines()
    blocks = difflib.SequenceMatcher(None, before, after, autojunk=False).get_opcodes()
    for kind, first, last, begin, end in blocks:
        if kind != "equal":
            return _joined(before[first:last], longest), _joined(after[begin:end], longest)
    return "", ""


def _joined(lines: list[str], longest: int) -> str:
    text = "; ".join(line.strip() for line in lines)
    return text if len(text) <= longest else f"{text[: longest - 1]}…"
