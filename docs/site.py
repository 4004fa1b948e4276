"""The pages of the site that are no files: those of the root, and the reference, made from the declarations."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import click
import typer.main
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from pydantic.fields import FieldInfo

from semidense import pipeline
from semidense.pipeline.cli.main import app
from semidense.stages.catalog import STAGES
from semidense.stages.stage import NoParams, Stage

ROOT = Path(__file__).parents[1]
_ORDERED = dict(sorted(STAGES.items(), key=lambda each: ".baselines." in each[1].compute))
"""The stages as a run comes to them, then the other matchers and measures."""
_BOUNDS = (("ge", "at least"), ("gt", "above"), ("le", "at most"), ("lt", "below"), ("min_length", "values, at least"))
"""Limits of a field, and how they are written."""
ROOT_PAGES = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
"""Files of the root, and what they are called on the site."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made here."""
    pages = {page: moved((ROOT / name).read_text(encoding="utf-8")) for name, page in ROOT_PAGES.items()}
    pages |= {"reference/commands.md": commands(), "reference/settings.md": settings()}
    pages |= {"reference/products.md": products(), "reference/python.md": python()}
    for name, content in pages.items():
        files.append(File.generated(config, name, content=content))
    return files


def on_page_markdown(markdown: str, **_: object) -> str:
    """Lead links of the repository to pages of the site."""
    for name, page in ROOT_PAGES.items():
        markdown = markdown.replace(f"](../{name}", f"]({page}")
    return markdown


def moved(text: str) -> str:
    """Return a file of the root with links that hold in ``docs``; what is not on the site becomes plain text."""
    text = text.replace("](docs/", "](")
    for name, page in ROOT_PAGES.items():
        text = text.replace(f"]({name}", f"]({page}")
    return re.sub(r"\[([^]]+)\]\((?:LICENSE|CITATION\.cff|stages/[^)]*)\)", r"\1", text)


def commands() -> str:
    """Return the page of the commands, from the command line's own help."""
    lines = ["# Commands", "", "What `pipeline COMMAND --help` prints."]
    return "\n".join([*lines, *_group(typer.main.get_command(app), "pipeline")])


def _group(command: click.Command, name: str) -> Iterator[str]:
    for each, inner in getattr(command, "commands", {}).items():
        if hasattr(inner, "commands"):
            yield from _group(inner, f"{name} {each}")
        elif not inner.hidden:
            context = click.Context(inner, info_name=f"{name} {each}", max_content_width=110, terminal_width=110)
            yield from ("", f"## {name} {each}", "", "```text", inner.get_help(context), "```")


def settings() -> str:
    """Return the page of the settings: a table a section, with default, range and meaning."""
    lines = ["# Settings", "", "Give them as `--set section.field=value`, or in a TOML file with `--config`."]
    for name, stage in _ORDERED.items():
        if stage.params is not NoParams:
            rows = [_setting(*each) for each in stage.params.model_fields.items()]
            about = (stage.params.__doc__ or "").split("\n")[0]
            lines += ["", f"## {name}", "", about, "", *_table(("setting", "default", "range", "meaning"), rows)]
    return "\n".join(lines)


def _setting(name: str, field: FieldInfo) -> tuple[str, ...]:
    default = json.dumps(field.get_default(call_default_factory=True), default=str)
    limits = [
        f"{words} {getattr(each, bound)}" for each in field.metadata for bound, words in _BOUNDS if hasattr(each, bound)
    ]
    return f"`{name}`", f"`{default}`", ", ".join(limits) or _choices(field), field.description or ""


def _choices(field: FieldInfo) -> str:
    """Return the values that a setting can take; empty where its type alone says it."""
    return ", ".join(re.findall(r"'([^']+)'", str(field.annotation))) if "Literal" in str(field.annotation) else ""


def products() -> str:
    """Return the page of the products: what each is made from, and its arrays."""
    about = "`--upto NAME` stops at a product; `Result.open(NAME)` and `pipeline inspect NAME` show one."
    lines = ["# Products", "", about]
    for name, stage in _ORDERED.items():
        lines += [
            "",
            f"## {name}",
            "",
            _inputs(stage),
            "",
            *_table(("array", "dims", "dtype", "unit", "what it is"), _arrays(stage)),
        ]
    return "\n".join(lines)


def _inputs(stage: Stage) -> str:
    return f"Made from {', '.join(f'`{each}`' for each in stage.inputs)}." if stage.inputs else "Made from files."


def _arrays(stage: Stage) -> list[tuple[str, ...]]:
    return [(f"`{each.name}`", ", ".join(each.dims), each.dtype, each.units, each.about) for each in stage.outputs]


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> Iterator[str]:
    yield f"| {' | '.join(head)} |"
    yield f"|{' --- |' * len(head)}"
    for row in rows:
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |"


def python() -> str:
    """Return the page of the Python interface: every public name of ``semidense.pipeline``, from its docstring."""
    lines = ["# Python", "", "All of these are in `semidense.pipeline`: `from semidense import pipeline`.", ""]
    return "\n".join([*lines, *(f"::: {_home(name)}\n" for name in pipeline.__all__)])


def _home(name: str) -> str:
    found = getattr(pipeline, name)
    return f"{found.__module__}.{found.__qualname__}"
