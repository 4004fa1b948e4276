"""Edits of a copy of the sources: a comment makes nothing stale, a line of code exactly what runs it."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from semidense.pipeline.results.result import Result
from tests.tiny import PATH, TRAINED

ALL = PATH
BELOW_CHANNELS = ALL - {"images", "truth", "matching_samples", "distinctiveness"}


@pytest.fixture(scope="module")
def sources(project: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder to import from, with a copy of the packages to edit."""
    folder = tmp_path_factory.mktemp("sources")
    for package in ("pipeline", "stages", "datasets", "cache"):
        shutil.copytree(project / package, folder / "semidense" / package, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def replace(text: str, old: str, new: str) -> str:
    assert old in text, "the sources have changed: choose another line to edit"
    return text.replace(old, new, 1)


@pytest.mark.parametrize(
    ("file", "edit", "stale", "named"),
    [
        pytest.param(
            "stages/transforms/rank.py",
            lambda text: "# a comment\n\n" + text.replace('"""', '"""Moved. ', 1) + "\n# the end\n",
            set(),
            set(),
            id="comment, docstring and lines",
        ),
        pytest.param(
            "stages/transforms/rank.py",
            lambda text: text + "\n\nUNUSED = 1\n",
            BELOW_CHANNELS,
            {"code.semidense.stages.transforms.rank"},
            id="code of a helper",
        ),
        pytest.param(
            "stages/evaluation/filtering.py",
            lambda text: replace(text, "confidence >= confidence.dtype", "confidence > confidence.dtype"),
            {"semidense", "metrics"},
            {"code.semidense.stages.evaluation.filtering"},
            id="code of a stage",
        ),
        pytest.param(
            "pipeline/cli/console.py",
            lambda text: text + "\n\nUNUSED = 1\n",
            set(),
            set(),
            id="code that makes no product",
        ),
    ],
)
def test_an_edit_of_the_sources(
    command: Callable[..., Any],
    sources: Path,
    trained: Result,
    file: str,
    edit: Callable[[str], str],
    stale: set[str],
    named: set[str],
) -> None:
    path = sources / "semidense" / file
    original = path.read_text()
    try:
        path.write_text(edit(original))
        ran = command("status", *TRAINED, "--cache", trained.store.root, "--json", sources=sources, cwd=sources)
    finally:
        path.write_text(original)
    assert ran.code == 0, ran.err
    steps = json.loads(ran.out)["steps"]
    assert {step["product"] for step in steps if step["state"] != "hit"} == stale
    fields = {change["field"] for step in steps for change in step["changed"]}
    assert {field for field in fields if not field.startswith("inputs.")} == named
