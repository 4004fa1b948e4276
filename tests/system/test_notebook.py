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
ANY_MATCHER = NOTEBOOK.with_name("any-matcher.ipynb")
PAGE = NOTEBOOK.with_suffix(".md")


@pytest.mark.slow
def test_the_notebook_runs_and_writes_its_cloud(tmp_path: Path, project: Path) -> None:
    from plyfile import PlyData

    count, share = _printed(NOTEBOOK, "len(cloud), known.mean()", tmp_path, project)
    assert len(PlyData.read(tmp_path / "points.ply")["vertex"]) == int(count)
    assert 0.6 <= float(share) < 0.65


@pytest.mark.slow
def test_the_notebook_on_any_matcher_runs(tmp_path: Path, project: Path) -> None:
    """SGBM's map is better where it is kept, and the volume's where it is summed."""
    pytest.importorskip("cv2", reason="the notebook calls OpenCV's matcher")
    told = "wrong(found.raw), wrong(found.disparity), wrong(single), wrong(summed), wrong(kept)"
    sgbm, sure, single, summed, kept = map(float, _printed(ANY_MATCHER, told, tmp_path, project))
    assert sure < sgbm / 2 and kept < summed < single


def _printed(notebook: Path, told: str, folder: Path, project: Path) -> list[str]:
    """Run the code of a notebook, and return what it has computed."""
    cells = json.loads(notebook.read_text())["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    environment = {**os.environ, "PYTHONPATH": str(project), "PIPELINE_CACHE": str(folder / "cache")}
    ran = subprocess.run(
        [sys.executable, "-c", f"{code}\nprint({told})"],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=280, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    return ran.stdout.split()


COMMANDS = re.findall(r"^pipeline .+", PAGE.read_text(), re.MULTILINE)


@pytest.mark.parametrize("line", COMMANDS)
def test_a_command_of_the_page_parses(line: str) -> None:
    parse(line)


def test_the_pictures_of_the_page_are_there() -> None:
    pictures = re.findall(r"\]\((pictures/[^)]+)\)", PAGE.read_text())
    assert pictures
    assert [name for name in pictures if not (PAGE.parent / name).is_file()] == []


@pytest.mark.parametrize("notebook", [NOTEBOOK, ANY_MATCHER], ids=lambda notebook: notebook.stem)
def test_a_notebook_ships_with_its_outputs(notebook: Path) -> None:
    cells = [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    shown = [output["data"] for cell in cells for output in cell["outputs"]]
    assert len(shown) >= 5
    assert any("image/png" in data for data in shown)
    assert "/tmp" not in json.dumps(shown), "an output names a folder of the machine that made it"
