"""Why a step is not a hit, down to its cause: the setting, the function, the file or the weights that changed.

A change of an input is followed to what made that input different, so every step below names the same cause.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

from semidense.cache import ABSENT, Change, Entry, Store, differences
from semidense.cache.entries.index import Index
from semidense.cache.keys.code import source_text
from semidense.cache.keys.recipe import is_hash
from semidense.cache.keys.sources import source_change
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.steps import Step

PENDING = "to be made again"
"""Stands in a ``Change`` for the digest of an input that is to be made before the step."""
_PATH_LENGTH = 60


class Causes:
    """Finds the causes of changes with the help of the entries of a cache."""

    def __init__(self, store: Store, entries: Iterable[Entry]) -> None:
        self._store = store
        self._index = Index(entries)
        self._code = cache(self._code_text)

    def of(self, step: Step, changes: Iterable[Change], above: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
        """Return the causes of a step's changes, one line each, without repetition.

        Args:
            step: the step.
            changes: of its recipe.
            above: causes of the steps that are not hits, by id; empty for one that is only gone.
        """
        return tuple(dict.fromkeys(cause for change in changes for cause in self._causes(step, change, above)))

    def _causes(self, step: Step, change: Change, above: Mapping[str, tuple[str, ...]]) -> Iterator[str]:
        part, _, name = change.field.partition(".")
        if change.new == PENDING:
            pending = [each for each in step.inputs.get(name, ()) if each in above]
            yield from (cause for each in pending for cause in above[each] or (f"{name} is not there any more",))
        elif part == "inputs":
            yield from self._input(name, change)
        else:
            yield self._own(step.stage.section or step.product, change, getattr(step.argument, "files", {}))

    def _own(self, product: str, change: Change, files: Mapping[str, Path]) -> str:
        """Return one line for a change of a recipe's own ingredient."""
        part, _, name = change.field.partition(".")
        if part == "code":
            return self._code(name, change)
        if change.field.startswith("params.files."):
            role = name.removeprefix("files.")
            where = f" {_shortened(files[role])}" if role in files else ""
            return f"input file {role}{where}: {_values(change)}"
        if change.field == "params.shipped":
            return f"weights of {product}: {_values(change)}"
        if part == "params":
            return f"{product}.{name}: {_values(_in_words(product, name, change))}"
        if part == "environment":
            return f"{name}: {_values(change)}"
        return "asked for by --force" if part == "forced" else str(change)

    def _input(self, product: str, change: Change) -> Iterator[str]:
        """Follow an input to what made its content different."""
        for old, new in _pairs(change.old, change.new):
            before, after = self._index.find(product, old), self._index.find(product, new)
            if before is None or after is None or before.key == after.key:
                yield f"content of {product}: {_values(Change('', old, new))}"
                continue
            for each in differences(before.recipe, after.recipe):
                if each.field.startswith("inputs."):
                    yield from self._input(each.field.removeprefix("inputs."), each)
                else:
                    yield self._own(product, each, {})

    def _code_text(self, module: str, change: Change) -> str:
        """Return file, function and lines of a change of code; without the old text, the module and its hashes."""
        file = f"{module.removeprefix('semidense.').replace('.', '/')}.py"
        if not is_hash(change.old):
            return f"code of {module} is now part of it"
        if not is_hash(change.new):
            return f"code of {module} is no longer part of it"
        old, new = self._store.kept_source(change.old), source_text(module)
        found = source_change(old, new) if old and new else None
        if found is None:
            return f"code {file}: {_values(change)}"
        where = f"{found.function}()" if found.function else "outside of functions"
        line = f" line {found.line}" if found.line else ""
        return f"code {file} {where}{line}: {found.old or 'nothing'} -> {found.new or 'nothing'}"


def _pairs(old: object, new: object) -> Iterator[tuple[str, str]]:
    """Yield the digests that differ; of inputs that are one a scene, the first."""
    if isinstance(old, str) and isinstance(new, str):
        yield old, new
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        yield from [(str(a), str(b)) for a, b in zip(old, new, strict=True) if a != b][:1]
    else:
        yield f"{len(old) if isinstance(old, list) else 0} scenes", f"{len(new) if isinstance(new, list) else 0} scenes"


def _in_words(product: str, name: str, change: Change) -> Change:
    """Return a change with the default in place of a setting that a recipe leaves out."""
    field = type(Config.load().section(product)).model_fields.get(name)
    if field is None or field.is_required():
        return change
    old, new = (field.default if value == ABSENT else value for value in (change.old, change.new))
    return replace(change, old=old, new=new)


def _values(change: Change) -> str:
    return str(change).removeprefix(f"{change.field}: ")


def _shortened(path: Path) -> str:
    text = str(path)
    return text if len(text) <= _PATH_LENGTH else f"…{text[-_PATH_LENGTH:]}"
