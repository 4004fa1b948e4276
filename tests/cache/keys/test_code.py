import ast
import gc
import itertools
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from semidense.cache.errors import SourceNotFound
from semidense.cache.keys.code import _locate, _parts, _read, code_parts
from semidense.cache.keys.trees import source_hash

Tree = Callable[..., str]
_numbers = itertools.count()


def _forget() -> None:
    for each in (_locate, _read, _parts):
        each.cache_clear()


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Tree]:
    """Write a package of the given files, ``PKG`` standing for its name; return the name."""
    monkeypatch.syspath_prepend(tmp_path)

    def write(files: dict[str, str], name: str | None = None) -> str:
        package = name or f"package_of_test_{next(_numbers)}"
        for path, text in {"__init__.py": "", **files}.items():
            file = tmp_path / package / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text.replace("PKG", package), encoding="utf-8")
        _forget()
        return package

    yield write
    _forget()


SOURCE = '''
"""About."""
import math

LIMIT = 3
"""What it limits."""


def area(r: float) -> float:
    """Return the area."""
    return math.pi * r**2  # of a circle


class Circle:
    """A circle."""

    r = 1
'''


@pytest.mark.parametrize(
    ("old", "new"),
    [
        pytest.param("# of a circle", "# of a disc", id="comment"),
        pytest.param("  # of a circle", "", id="comment gone"),
        pytest.param('"""About."""\n', "", id="module docstring"),
        pytest.param("Return the area", "Compute it", id="function docstring"),
        pytest.param('    """A circle."""\n', "", id="class docstring"),
        pytest.param("What it limits", "The limit", id="note under an assignment"),
        pytest.param("\n\n\ndef", "\n\n\n\n\n\ndef", id="position"),
        pytest.param("math.pi * r**2", "(math.pi\n        * r ** 2)", id="layout"),
        pytest.param("import math", "import math\n# more\n", id="comment line"),
    ],
)
def test_text_edits_do_not_change_the_hash(tree: Tree, old: str, new: str) -> None:
    assert old in SOURCE
    package = tree({"m.py": SOURCE})
    before = code_parts(f"{package}.m", (package,))
    tree({"m.py": SOURCE.replace(old, new, 1)}, package)
    assert code_parts(f"{package}.m", (package,)) == before


@pytest.mark.parametrize(
    ("old", "new"),
    [
        pytest.param("r**2", "r**3", id="number"),
        pytest.param("LIMIT = 3", "LIMIT = 3.0", id="type of a constant"),
        pytest.param("LIMIT = 3", "LIMIT = '3'", id="text"),
        pytest.param("math.pi", "math.e", id="name"),
        pytest.param("    r = 1", "    r = 2", id="class attribute"),
    ],
)
def test_code_edits_change_the_hash(tree: Tree, old: str, new: str) -> None:
    package = tree({"m.py": SOURCE})
    before = code_parts(f"{package}.m", (package,))
    tree({"m.py": SOURCE.replace(old, new, 1)}, package)
    assert code_parts(f"{package}.m", (package,)) != before


@pytest.mark.parametrize(
    "statement",
    [
        pytest.param("import PKG.sub.helper", id="import"),
        pytest.param("import PKG.sub.helper as h", id="import as"),
        pytest.param("from PKG.sub import helper", id="from package import module"),
        pytest.param("from PKG.sub.helper import f", id="from module import name"),
        pytest.param("from PKG.sub.helper import *", id="star from module"),
        pytest.param("from PKG.sub import *", id="star from package"),
        pytest.param("from .sub import helper", id="relative module"),
        pytest.param("from .sub.helper import f as g", id="relative name"),
        pytest.param("def f():\n    from PKG.sub import helper", id="inside a function"),
        pytest.param("try:\n    import PKG.sub.helper\nexcept ImportError:\n    pass", id="inside try"),
        pytest.param("if 0:\n    pass\nelse:\n    import os, PKG.sub.helper", id="second of two"),
        pytest.param("import importlib\nimportlib.import_module('PKG.sub.helper')", id="import_module"),
        pytest.param(
            "from importlib import import_module as i, import_module\nimport_module('.sub.helper', 'PKG')",
            id="relative import_module",
        ),
        pytest.param("__import__('PKG.sub.helper')", id="__import__"),
        pytest.param("from PKG import middle", id="through another module"),
        pytest.param("from . import middle", id="from . import"),
    ],
)
def test_each_import_form_is_followed(tree: Tree, statement: str) -> None:
    files = {
        "m.py": statement,
        "middle.py": "from .sub.deeper import leaf",
        "sub/__init__.py": "",
        "sub/helper.py": "X = 1",
        "sub/deeper/__init__.py": "from ... import other",
        "sub/deeper/leaf.py": "from .. import helper",
        "other.py": "",
    }
    package = tree(files)
    before = code_parts(f"{package}.m", (package,))
    assert f"{package}.sub.helper" in before
    tree({**files, "sub/helper.py": "X = 2"}, package)
    after = code_parts(f"{package}.m", (package,))
    assert {name for name in before if before[name] != after[name]} == {f"{package}.sub.helper"}


OFFERING = (
    "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from PKG.lazy.one import f\n    from .two import g\n"
)


@pytest.mark.parametrize(
    ("statement", "followed"),
    [
        pytest.param("from PKG.lazy import f", {"one"}, id="the name's own module"),
        pytest.param("from .lazy import g", {"two"}, id="the same of a relative name"),
        pytest.param("from PKG import lazy", {"one", "two"}, id="all that the package offers"),
        pytest.param("import PKG.lazy", {"one", "two"}, id="imported as a whole"),
        pytest.param("import typing\nif typing.TYPE_CHECKING:\n    from PKG.lazy import f", set(), id="never runs"),
        pytest.param("if TYPE_CHECKING:\n    pass\nelse:\n    from PKG.lazy import f", {"one"}, id="the other branch"),
    ],
)
def test_names_that_are_imported_when_they_are_used_are_followed_to_their_modules(
    tree: Tree, statement: str, followed: set[str]
) -> None:
    package = tree({"m.py": statement, "lazy/__init__.py": OFFERING, "lazy/one.py": "", "lazy/two.py": ""})
    parts = code_parts(f"{package}.m", (package,))
    assert {name.rpartition(".")[2] for name in parts} & {"one", "two"} == followed


def test_parent_packages_count(tree: Tree) -> None:
    package = tree({"__init__.py": "from .setup import X", "setup.py": "X = 1", "sub/__init__.py": "", "sub/m.py": ""})
    parts = code_parts(f"{package}.sub.m", (package,))
    assert list(parts) == [package, f"{package}.setup", f"{package}.sub", f"{package}.sub.m"]


def test_a_module_with_its_package_s_relative_imports(tree: Tree) -> None:
    package = tree({"sub/__init__.py": "from .a import X\nfrom ..b import Y", "sub/a.py": "", "b.py": ""})
    assert set(code_parts(f"{package}.sub", (package,))) == {
        package,
        f"{package}.sub",
        f"{package}.sub.a",
        f"{package}.b",
    }


def test_cycles_end(tree: Tree) -> None:
    package = tree({"a.py": "from PKG import b", "b.py": "from PKG import a"})
    assert code_parts(f"{package}.a", (package,)) == code_parts(f"{package}.b", (package,))


def test_packages_without_init_and_other_packages(tree: Tree) -> None:
    package = tree({"space/m.py": "import json, numpy, unheard_of\nfrom PKG.space import data", "space/data/x.txt": ""})
    assert set(code_parts(f"{package}.space.m", (package,))) == {package, f"{package}.space.m"}


def test_nothing_is_imported(tree: Tree) -> None:
    package = tree({"__init__.py": "raise SystemExit", "m.py": "raise SystemExit"})
    assert code_parts(f"{package}.m", (package,))
    assert package not in sys.modules


def test_the_same_source_elsewhere_has_the_same_hash(tree: Tree) -> None:
    first, second = (tree({"m.py": SOURCE}) for _ in range(2))
    assert code_parts(f"{first}.m", (first,))[f"{first}.m"] == code_parts(f"{second}.m", (second,))[f"{second}.m"]


def test_files_are_read_once_a_process(tree: Tree) -> None:
    package = tree({"m.py": "X = 1"})
    before = code_parts(f"{package}.m", (package,))
    assert _locate(f"{package}.m") is not None
    file = Path(str(_locate(f"{package}.m").file))  # type: ignore[union-attr]
    file.write_text("X = 2", encoding="utf-8")
    assert code_parts(f"{package}.m", (package,)) == before


def test_the_result_is_the_callers_own(tree: Tree) -> None:
    package = tree({"m.py": ""})
    code_parts(f"{package}.m", (package,)).clear()
    assert code_parts(f"{package}.m", (package,))


@pytest.mark.parametrize(
    ("files", "module"),
    [
        pytest.param({}, "PKG.missing", id="no such module"),
        pytest.param({}, "unheard_of.module", id="no such package"),
        pytest.param({}, "__main__", id="a script"),
        pytest.param({"m.py": "def ("}, "PKG.m", id="not Python"),
        pytest.param({"m.py": "x = '\0'"}, "PKG.m", id="a NUL byte"),
        pytest.param({"m.py": "from ... import x"}, "PKG.m", id="relative beyond the top"),
    ],
)
def test_refuses(tree: Tree, files: dict[str, str], module: str) -> None:
    package = tree(files)
    with pytest.raises(SourceNotFound, match=r"^[^\n]+$"):
        code_parts(module.replace("PKG", package), (package,))


EDITING = """
import importlib, sys, time
from pathlib import Path
sys.path.insert(0, sys.argv[1])
module = Path(sys.argv[1]) / "edited" / "stage.py"
from semidense.cache.errors import EditedSource
from semidense.cache.keys.code import code_parts, require_imported_as_hashed

def edit():
    time.sleep(0.1)
    module.write_text("x = 2\\n")

def hashes():
    return code_parts("edited.stage", ("edited",))

def look():
    require_imported_as_hashed(["edited.stage", "not.imported"])

for act in sys.argv[2].split():
    if act == "import":
        import edited.stage
    elif act == "reload":
        importlib.reload(edited.stage)
    else:
        try:
            {"edit": edit, "hash": hashes, "look": look}[act]()
        except EditedSource as error:
            print("refused", error)
print("end")
"""


@pytest.mark.parametrize(
    ("acts", "refused"),
    [
        pytest.param("import hash look", 0, id="nothing is edited"),
        pytest.param("import edit hash", 1, id="old code would run under the new text's key"),
        pytest.param("import edit hash hash", 2, id="and again"),
        pytest.param("hash edit import look", 1, id="new code would run under the old text's key"),
        pytest.param("edit hash import look", 0, id="edited before both"),
        pytest.param("import hash edit hash look", 0, id="what runs is what was hashed"),
        pytest.param("hash import look edit look", 0, id="known to be the same by then"),
        pytest.param("hash edit look", 0, id="never imported"),
        pytest.param("import hash edit reload look hash", 2, id="reloaded, new code would run under the old key"),
        pytest.param("import hash look reload look hash", 0, id="reloaded as it was"),
    ],
)
def test_what_runs_is_what_was_hashed(tmp_path: Path, acts: str, refused: int) -> None:
    (tmp_path / "edited").mkdir()
    (tmp_path / "edited" / "__init__.py").write_text("")
    (tmp_path / "edited" / "stage.py").write_text("x = 1\n")
    done = subprocess.run([sys.executable, "-c", EDITING, str(tmp_path), acts], capture_output=True, text=True)
    *said, last = done.stdout.splitlines()
    assert (last, done.stderr) == ("end", "")
    assert len(said) == refused
    for line in said:
        assert line.startswith(f"refused {tmp_path / 'edited' / 'stage.py'} was edited since this Python began")
        assert line.endswith("restart Python (the kernel)")


def test_a_clock_that_was_set_back_is_told(tmp_path: Path) -> None:
    (tmp_path / "edited").mkdir()
    (tmp_path / "edited" / "stage.py").write_text("x = 1\n")
    back = EDITING.replace("def edit():", "now = time.time\ntime.time = lambda: now() - 1e6\n\ndef edit():")
    done = subprocess.run([sys.executable, "-c", back, str(tmp_path), "import hash"], capture_output=True, text=True)
    assert (done.stdout.splitlines()[-1], done.stderr) == ("end", "")
    assert "stage.py was changed in the future: the clock was set back" in done.stdout


def test_threads_hash_at_the_same_time() -> None:
    """Python 3.11 fails if one thread makes a syntax tree while another is interrupted in making one."""
    text = Path(ast.__file__).read_text()

    def interrupt(*_: object) -> None:
        time.sleep(0)

    gc.callbacks.append(interrupt)
    try:
        with ThreadPoolExecutor(2) as pool:
            assert len(set(pool.map(source_hash, [text] * 8))) == 1
    finally:
        gc.callbacks.remove(interrupt)
