"""Hash the source that a result depends on, so that a helper's change makes it stale and a comment does not.

Followed are import statements anywhere in a file, relative ones too, ``import_module`` with a
literal name, and the ``__init__`` of every parent package, which Python runs first. What stands
under ``if TYPE_CHECKING`` never runs; it tells where a package's names come from that are imported
when they are used, and those that a file takes are followed. Not followed is a submodule that is
only reached as an attribute and that another module imports. Modules are found and parsed, never
imported. A module that runs already must have been imported from the text that is hashed: one whose
file changed since this process began is refused.
"""

import ast
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.machinery import ModuleSpec
from importlib.util import find_spec, resolve_name
from pathlib import Path

from semidense.cache.document import digest
from semidense.cache.errors import EditedSource, SourceNotFound
from semidense.cache.keys.imported import Stamp, process_start, stamp_of
from semidense.cache.keys.trees import (
    is_for_checkers,
    literal_import,
    may_import_by_call,
    parsed,
    running,
    source_hash,
    tree_hash,
    without_docstrings,
)


@dataclass(frozen=True)
class _Module:
    """Where a module is: its source file (None for a package without ``__init__``) and its package folders."""

    name: str
    file: Path | None
    folders: tuple[Path, ...]

    @property
    def package(self) -> str:
        """The package that relative imports start from."""
        return self.name if self.folders else self.name.rpartition(".")[0]

    def has_folder(self, name: str) -> bool:
        """Return whether one of the package's folders holds a folder or a module of a name."""
        return any((folder / name).is_dir() or (folder / f"{name}.py").is_file() for folder in self.folders)


def code_hash_of(parts: Mapping[str, str]) -> str:
    """Return one hash over the modules of a recipe, as ``code_parts`` gave them."""
    return digest(parts)


def code_parts(module: str, packages: tuple[str, ...]) -> dict[str, str]:
    """Return the hash of ``module`` and of all it imports from ``packages``, by module name.

    A hash is over the file's syntax tree without comments, docstrings and positions. Files are
    read once a process: what is already imported does not change either.

    Args:
        module: dotted name of the module that the result starts from.
        packages: top-level packages that are followed; any other is the environment's business.

    Raises:
        SourceNotFound: if ``module`` has no Python source, or a file cannot be read or parsed.
        EditedSource: if the file of a module that was imported changed since this process began, or a module was
            reloaded.
    """
    parts = _parts(module, packages)
    require_imported_as_hashed(parts)
    return dict(parts)


@cache
def _parts(module: str, packages: tuple[str, ...]) -> Mapping[str, str]:
    """Return what ``code_parts`` does, worked out once a process; nobody may change it."""
    found: dict[str, str] = {}
    waiting = [module]
    if _locate(module) is None:
        raise SourceNotFound(f"no Python source for the module {module!r}: is its package installed?")
    while waiting:
        name = waiting.pop()
        if name not in found and (located := _locate(name)) and located.file:
            source = _read(located)
            found[name] = source.hash
            followed = (each for each in (name, *source.imports) if each.partition(".")[0] in packages)
            waiting += (part for each in followed for part in _parents(each))
    return dict(sorted(found.items()))


def source_text(module: str) -> str | None:
    """Return the text that ``code_parts`` hashed for a module, None if it has none."""
    located = _locate(module)
    return _read(located).text if located and located.file else None


def module_hash(module: str) -> str | None:
    """Return the hash that ``code_parts`` gives one module here, None if it has no source here.

    Raises:
        SourceNotFound, EditedSource: as ``code_parts`` does.
    """
    located = _locate(module)
    return _read(located).hash if located and located.file else None


def require_imported_as_hashed(modules: Iterable[str]) -> None:
    """Refuse a module that runs under another text's key: hashed, edited and then imported, or reloaded.

    Args:
        modules: names; those that were never imported need no look.

    Raises:
        EditedSource: naming the file.
    """
    for name in modules:
        if name not in sys.modules:
            continue
        spec = getattr(sys.modules[name], "__spec__", None)
        if name in _settled and _settled[name] is spec:
            continue
        located = _locate(name)
        if located and located.file:
            known = _read(located)
            if stamp_of(located.file) != known.stamp and (
                name in _settled or source_hash(located.file.read_bytes()) != known.hash
            ):
                raise EditedSource(_edited(located.file))
        _settled[name] = spec


def _parents(module: str) -> Iterator[str]:
    """Return the module and the packages that it is in: importing it runs them all."""
    parts = module.split(".")
    return (".".join(parts[: end + 1]) for end in range(len(parts)))


@cache
def _locate(module: str) -> _Module | None:
    """Find a module without importing anything; None if there is none."""
    parent, _, name = module.rpartition(".")
    package = _locate(parent) if parent else None
    if not parent or (package and package.file is None and not package.has_folder(name)):
        return _locate_by_import_system(module)
    for folder in package.folders if package else ():
        if (file := folder / name / "__init__.py").is_file():
            return _Module(module, file, (folder / name,))
        if (file := folder / f"{name}.py").is_file():
            return _Module(module, file, ())
    folders = tuple(folder / name for folder in (package.folders if package else ()) if (folder / name).is_dir())
    return _Module(module, None, folders) if folders else None


def _locate_by_import_system(name: str) -> _Module | None:
    """Find a top-level module, or a portion of a namespace package: an editable install has it elsewhere.

    Looking for one imports nothing but the namespace package, which has no code.
    """
    try:
        spec = find_spec(name)
    except (ImportError, ValueError):
        return None
    if spec is None or spec.name != name:  # a running script is known by another name
        return None
    file = Path(spec.origin) if spec.has_location and spec.origin and spec.origin.endswith(".py") else None
    folders = tuple(Path(folder) for folder in spec.submodule_search_locations or ())
    return _Module(name, file, folders) if file or folders else None


_settled: dict[str, ModuleSpec | None] = {}
"""Modules that are known to run the text that was hashed, as they were imported: a later import makes another spec.

What happens to their files does not matter any more, until one is imported again."""


@dataclass(frozen=True)
class _Source:
    """A module's source: the hash of its tree, the dotted names that it may import, its text, and its file's stamp."""

    hash: str
    imports: frozenset[str]
    text: str
    stamp: Stamp


@cache
def _read(module: _Module) -> _Source:
    file, is_imported = module.file or Path(), module.name in sys.modules
    try:
        stamp, data = stamp_of(file), file.read_bytes()
        tree = parsed(data)
        imports = frozenset(_imports(tree, module, may_import_by_call(data)))
        hashed = tree_hash(without_docstrings(tree))
    except (OSError, SyntaxError, ValueError, RecursionError) as error:
        raise SourceNotFound(f"cannot read the source {module.file}: {error}") from error
    if is_imported:
        if file.stat().st_ctime > process_start():
            raise EditedSource(_edited(file))
        _settled[module.name] = getattr(sys.modules[module.name], "__spec__", None)
    return _Source(hashed, imports, data.decode("utf-8", "replace"), stamp)


def _edited(file: Path) -> str:
    if file.stat().st_ctime > time.time():
        return f"{file} was changed in the future: the clock was set back; set it right, or wait until then"
    return f"{file} was edited since this Python began, and may have been imported before: restart Python (the kernel)"


def _imports(tree: ast.AST, module: _Module, by_call: bool) -> Iterator[str]:
    """Yield each dotted name that might be a module imported here; names of other things do no harm."""
    for node in running(tree, by_call):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from (alias.name, *_offered(alias.name).values())
        elif isinstance(node, ast.ImportFrom):
            base = _absolute("." * node.level + (node.module or ""), module)
            yield base
            for alias in node.names:
                yield from _submodules(base) if alias.name == "*" else _named(base, alias.name)
        elif isinstance(node, ast.Call) and (name := literal_import(node)):
            yield _absolute(name, module)


def _named(base: str, name: str) -> Iterator[str]:
    """Yield what ``from base import name`` may import: a module, all that it offers, or what ``base`` takes it from."""
    yield f"{base}.{name}"
    yield from _offered(f"{base}.{name}").values()
    yield from [home] if (home := _offered(base).get(name)) else []


@cache
def _offered(package: str) -> Mapping[str, str]:
    """Return the names that a package imports when they are used, with the modules that they come from."""
    located = _locate(package)
    if not located or not located.file or not located.folders:
        return {}
    try:
        tree = parsed(located.file.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return {}  # reading the package itself says what is wrong
    blocks = (node.body for node in tree.body if is_for_checkers(node))
    nodes = [node for body in blocks for node in body if isinstance(node, ast.ImportFrom)]
    named = [(alias, "." * node.level + (node.module or "")) for node in nodes for alias in node.names]
    return {alias.asname or alias.name: _absolute(module, located) for alias, module in named}


def _absolute(name: str, module: _Module) -> str:
    """Resolve a relative name from the module's package."""
    try:
        return resolve_name(name, module.package)
    except ImportError as error:
        raise SourceNotFound(f"{module.file} imports {name!r}: {error}") from error


def _submodules(package: str) -> Iterator[str]:
    """Yield every module directly in a package: a star import may bring in any of them."""
    located = _locate(package)
    for folder in located.folders if located else ():
        yield from (f"{package}.{path.stem}" for path in sorted(folder.iterdir()) if path.stem.isidentifier())
