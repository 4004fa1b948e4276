"""The notebook of the documentation runs from top to bottom, and its page shows commands that exist."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.system.test_readme import parse

NOTEBOOK = Path(__file__).parents[2] / "docs" / "own-pictures.ipynb"
PAGE = NOTEBOOK.with_suffix(".md")


@pytest.mark.slow
def test_the_notebook_runs_and_writes_its_cloud(tmp_path: Path, project: Path) -> None:
    from plyfile import PlyData

    cells = json.loads(NOTEBOOK.read_text())["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    environment = {**os.environ, "PYTHONPATH": str(project), "PIPELINE_CACHE": str(tmp_path / "cache")}
    ran = subprocess.run(
        [sys.executable, "-c", f"{code}\nprint(len(cloud), known.mean())"],
        cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=280, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    count, share = ran.stdout.split()
    assert len(PlyData.read(tmp_path / "points.ply")["vertex"]) == int(count)
    assert 0.6 <= float(share) < 0.65


COMMANDS = re.findall(r"^pipeline .+", PAGE.read_text(), re.MULTILINE)


@pytest.mark.parametrize("line", COMMANDS)
def test_a_command_of_the_page_parses(line: str) -> None:
    parse(line)


def test_the_pictures_of_the_page_are_there() -> None:
    pictures = re.findall(r"\]\((pictures/[^)]+)\)", PAGE.read_text())
    assert pictures
    assert [name for name in pictures if not (PAGE.parent / name).is_file()] == []


def test_the_notebook_ships_with_its_outputs() -> None:
    cells = [cell for cell in json.loads(NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    shown = [output["data"] for cell in cells for output in cell["outputs"]]
    assert len(shown) >= 5
    assert any("image/png" in data for data in shown)
    assert "/tmp" not in json.dumps(shown), "an output names a folder of the machine that made it"
