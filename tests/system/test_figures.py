"""Measured figures in the documents, in tables and in running text, name their command; Python examples import."""

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
    r"|<!-- make faults -->",
    re.MULTILINE,
)
"""A command."""


TOLD = re.compile(r"\d+\.\d+ (%|points)|\b0\.0\d{3}\b|\b\d+\.\d+ (s|[GM]B)\b")
"""A measured figure in running text: a number with a decimal point and a unit, or an area under the error curve."""
LINK = re.compile(r"\]\([^)]+\)")
"""A link: to the section that has the figure, and its command."""


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


def untold(text: str) -> list[str]:
    """Return the paragraphs that quote figures in sections that name no command and lead to none."""
    return [
        f"{heading}: {paragraph}"
        for heading, body in sections(text)
        if not NAMED.search(body) and not LINK.search(body)
        for paragraph in re.sub(r"```.*?```|`[^`]*`", "", TABLE.sub("", body), flags=re.DOTALL).split("\n\n")
        if TOLD.search(paragraph)
    ]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda each: each.name)
def test_a_table_of_figures_names_its_command(document: Path) -> None:
    assert unnamed(document.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda each: each.name)
def test_a_section_that_tells_figures_names_a_command(document: Path) -> None:
    assert untold(document.read_text(encoding="utf-8")) == []


HEAD = "## Speed\n\n| | seconds |\n|---|---|\n| ours | 1.5 |\n| theirs | 2.5 |\n"


@pytest.mark.parametrize(
    ("beside", "found"),
    [
        pytest.param("", True, id="no command"),
        pytest.param("`python -m benchmarks.peers` prints it.\n", False, id="a command"),
        pytest.param("```\npipeline run motorcycle\n```\n", False, id="a block"),
        pytest.param("This was a trial without a command.\n", True, id="a trial"),
        pytest.param("\n## Next\n\n`make bench`\n", True, id="the command of another section"),
    ],
)
def test_a_table_without_a_command_is_found(beside: str, found: bool) -> None:
    assert bool(unnamed(HEAD + beside)) is found


@pytest.mark.parametrize(
    ("told", "found"),
    [
        pytest.param("Of these 1.4 % are wrong.", True, id="a share"),
        pytest.param("The AUC is 0.0428.", True, id="an area"),
        pytest.param("It takes 2.5 s.", True, id="a time"),
        pytest.param("`pipeline run motorcycle` prints 1.4 %.", False, id="a command"),
        pytest.param("Of these 1.4 % are wrong ([table](accuracy.md)).", False, id="a link to the table"),
        pytest.param("A trial without a command: 1.4 % are wrong.", True, id="a trial"),
        pytest.param("`--density 1.4 %`, from version 0.1 on, keeps 80 % of the 3 x 3 px.", False, id="no measurement"),
    ],
)
def test_a_figure_in_running_text_without_a_command_is_found(told: str, found: bool) -> None:
    assert bool(untold(f"## Speed\n\nFirst.\n\n{told}\n")) is found


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
