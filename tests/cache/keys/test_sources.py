from pathlib import Path

import pytest

from semidense.cache import Store, code_parts
from semidense.cache.keys.sources import SourceChange, source_change

OLD = '''"""Text."""
import math

LIMIT = 3


def f(x):
    """Say."""
    return x > LIMIT


class A:
    def g(self):
        return 1
'''


@pytest.mark.parametrize(
    ("edit", "expected"),
    [
        pytest.param(("x > LIMIT", "x >= LIMIT"), ("f", 7, "return x > LIMIT", "return x >= LIMIT"), id="a function"),
        pytest.param(("return 1", "return 2"), ("A.g", 13, "return 1", "return 2"), id="a method"),
        pytest.param(("LIMIT = 3", "LIMIT = 4"), ("", 2, "LIMIT = 3", "LIMIT = 4"), id="outside of functions"),
        pytest.param(("def f", "def h"), ("h", 7, "", "def h(x):; return x > LIMIT"), id="another name"),
        pytest.param(("class A:", "class A(B):"), ("A", 12, "", "B"), id="a base"),
    ],
)
def test_the_place_that_changed_is_named(edit: tuple[str, str], expected: tuple[str, int, str, str]) -> None:
    assert source_change(OLD, OLD.replace(*edit)) == SourceChange(*expected)


@pytest.mark.parametrize("edit", [('"""Text."""', '"""Other."""'), ("LIMIT = 3", "LIMIT  =  3  # px"), ("Say", "Tell")])
def test_text_and_layout_are_no_change(edit: tuple[str, str]) -> None:
    assert source_change(OLD, OLD.replace(*edit)) is None


def test_a_function_that_is_gone_is_named() -> None:
    change = source_change(OLD, OLD.replace('def f(x):\n    """Say."""\n    return x > LIMIT\n', ""))
    assert change
    assert (change.function, change.line, change.new) == ("f", 0, "")


def test_texts_are_kept_under_their_hash(store: Store) -> None:
    parts = code_parts("semidense.cache.keys.recipe", ("semidense",))
    store.keep_sources(parts)
    store.keep_sources(parts)
    text = store.kept_source(parts["semidense.cache.keys.recipe"])
    assert text
    assert "class Recipe" in text
    assert not list(store.root.rglob(".*.py.*")), "nothing half-written"


@pytest.mark.parametrize("damage", ["x = 1", "x = (", "\0", ""])
def test_a_text_that_is_not_the_one_is_not_taken(store: Store, damage: str) -> None:
    parts = code_parts("semidense.cache.keys.recipe", ("semidense",))
    store.keep_sources(parts)
    store.layout.source(parts["semidense.cache.keys.recipe"]).write_text(damage)
    assert store.kept_source(parts["semidense.cache.keys.recipe"]) is None


def test_what_cannot_be_kept_is_left_out(tmp_path: Path, store: Store) -> None:
    store.keep_sources({"no.such.module": "ab" * 32, "semidense.cache.keys.recipe": "cd" * 32, "x": "no hash"})
    assert store.kept_source("ab" * 32) is store.kept_source("cd" * 32) is None
    (tmp_path / "file").write_text("x")
    Store(tmp_path / "file").keep_sources(code_parts("semidense.cache.keys.recipe", ("semidense",)))
