"""Every table of measured figures in the documents names the command that makes it, and Python examples import."""

import ast
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.system.test_links import ROOT

DOCUMENTS = [ROOT / "README.md", *sorted(ROOT.glob("docs/*.md")), ROOT / "stages" / "weights" / "README.md"]
TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)
MEASURED = re.compile(r"[\s*<>~-]*\d[\d.,]*( %)?[\s*]*")
"""A cell that is a number and nothing else."""
NAMED = re.compile(
    r"`[^`]*(pipeline \w|python -m (benchmarks|tests)\.|make \w|--\w)[^`]*`|^(pipeline|python -m) "
    r"|<!-- make faults -->|trials?\s+without\s+a\s+command",
    re.MULTILINE,
)
"""A command, or the remark that there is no command."""


def sections(text: str) -> Iterator[tuple[str, str]]:
    """Yield the heading and the text of each section, without those below it."""
    for part in re.split(r"^(?=#+ )", re.sub(r"^# ", "## ", text, flags=re.MULTILINE), flags=re.MULTILINE):
        heading, _, body = part.partition("\n")
        yield heading, body


def quotes_figures(table: str) -> bool:
    """Return whether a table holds measured figures: two numbers with a decimal point or a percent sign."""
    cells = [cell for row in table.splitlines()[2:] for cell in row.strip("|").split("|")[1:]]
    numbers = [cell for cell in cells if MEASURED.fullmatch(cell)]
    return sum("." in each or "%" in each for each in numbers) >= 2


def unnamed(text: str) -> list[str]:
    """Return the heads of the tables of figures whose section names no command."""
    return [
        f"{heading}: {table.splitlines()[0]}"
        for heading, body in sections(text)
        for table in TABLE.findall(body)
        if quotes_figures(table) and not NAMED.search(body.replace(table, ""))
    ]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda each: each.name)
def test_a_table_of_figures_names_its_command(document: Path) -> None:
    assert unnamed(document.read_text(encoding="utf-8")) == []


HEAD = "## Speed\n\n| | seconds |\n|---|---|\n| ours | 1.5 |\n| theirs | 2.5 |\n"


@pytest.mark.parametrize(
    ("beside", "found"),
    [
        pytest.param("", True, id="no command"),
        pytest.param("`python -m benchmarks.peers` prints it.\n", False, id="a command"),
        pytest.param("```\npipeline run motorcycle\n```\n", False, id="a block"),
        pytest.param("This was a trial without a command.\n", False, id="a trial"),
        pytest.param("\n## Next\n\n`make bench`\n", True, id="the command of another section"),
    ],
)
def test_a_table_without_a_command_is_found(beside: str, found: bool) -> None:
    assert bool(unnamed(HEAD + beside)) is found


def test_figures_are_found_in_the_documents() -> None:
    tables = [table for each in DOCUMENTS for table in TABLE.findall(each.read_text(encoding="utf-8"))]
    assert sum(map(quotes_figures, tables)) > 15


def imports(document: Path) -> Iterator[tuple[str, str]]:
    """Yield module and name of what the Python examples of a page import from this project."""
    for block in re.findall(r"^```python\n(.*?)^```", document.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom) and str(node.module).split(".")[0] == "semidense":
                yield from ((str(node.module), each.name) for each in node.names)
            if isinstance(node, ast.Import):
                yield from ((each.name, "") for each in node.names if each.name.split(".")[0] in OURS)


OURS = ("semidense", "pipeline", "stages", "datasets", "cache")


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda each: each.name)
def test_the_imports_of_a_python_example_are_there(document: Path) -> None:
    for module, name in imports(document):
        assert module.split(".")[0] == "semidense", f"import {module}: from semidense"
        found = importlib.import_module(module)
        assert not name or hasattr(found, name) or importlib.import_module(f"{module}.{name}")
