"""A stage and a dataset of another package, which is installed beside: it needs no line in this project."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import ENTRY

EXTENSION = Path(__file__).parents[1] / "extension"
RUN = ("rig:3", "--set", "costvolume.mode=fast")
Extended = Callable[..., str]


@pytest.fixture(scope="module")
def extended(tmp_path_factory: pytest.TempPathFactory) -> Extended:
    """Run a command in an environment that has the package, on one cache; return what it prints."""
    cache = tmp_path_factory.mktemp("extension") / "cache"
    paths = os.pathsep.join([str(EXTENSION), *filter(None, [os.environ.get("PYTHONPATH")])])

    def run(*arguments: object) -> str:
        command = [*ENTRY, *map(str, arguments), "--cache", str(cache)]
        environment = {**os.environ, "PYTHONPATH": paths}
        done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    run("run", *RUN, "--upto", "roughness")
    return run


def _states(printed: str) -> dict[str, str]:
    return {step["product"]: step["state"] for step in json.loads(printed)["steps"]}


def test_the_package_is_fifty_lines() -> None:
    files = (EXTENSION / "stereo_extras").glob("*.py")
    lines = [line for file in files for line in file.read_text().splitlines() if line.strip()]
    assert len(lines) <= 60


def test_status_knows_what_a_setting_of_the_stage_changes(extended: Extended) -> None:
    same = _states(extended("status", *RUN, "--upto", "roughness", "--json"))
    assert set(same.values()) == {"hit"}
    changed = extended("status", *RUN, "--upto", "roughness", "--set", "roughness.reach=2", "--json")
    assert {product for product, state in _states(changed).items() if state != "hit"} == {"roughness"}
    assert [step["why"] for step in json.loads(changed)["steps"]][-1] == ["roughness.reach: 1 -> 2"]


def test_the_key_holds_the_code_of_the_package(extended: Extended) -> None:
    recipe: dict[str, Any] = json.loads(extended("explain", "roughness", *RUN, "--json"))["recipe"]
    assert {"stereo_extras", "stereo_extras.roughness", "semidense.stages.stage"} <= set(recipe["code"])
    images = json.loads(extended("explain", "images", *RUN, "--json"))["recipe"]
    assert "stereo_extras.rig" in images["code"], "the reader's code decides the images"


def test_inspect_opens_and_draws_it(extended: Extended, tmp_path: Path) -> None:
    found = json.loads(extended("inspect", "roughness", *RUN, "--png", tmp_path / "it.png", "--json"))
    assert [(row["name"], row["units"]) for row in found["arrays"]] == [("roughness", "px")]
    assert (tmp_path / "it.png").stat().st_size > 1000


def test_listing_and_cleaning_know_it(extended: Extended) -> None:
    rows = json.loads(extended("cache", "ls", "--product", "roughness", "--json"))["entries"]
    assert [row["dataset"] for row in rows] == ["rig"]
    doomed = json.loads(extended("cache", "gc", "--keep", "rig:4", "--json"))["items"]
    assert rows[0]["key"] in {item["name"] for item in doomed}


def test_the_settings_are_checked_as_ours_are(extended: Extended) -> None:
    with pytest.raises(AssertionError, match=r"roughness has no setting 'reech'; did you mean roughness\.reach\?"):
        extended("status", *RUN, "--upto", "roughness", "--set", "roughness.reech=2")


def test_without_the_package_its_products_are_unknown() -> None:
    done = subprocess.run(
        [*ENTRY, "status", "--upto", "roughness"], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert done.stderr.startswith("pipeline: no product 'roughness'")


def test_a_plug_in_that_cannot_be_loaded_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "broken-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (folder / "entry_points.txt").write_text("[semidense.stages]\nbroken = no_such_module:STAGE\n")
    paths = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, *ENTRY[1:], "status"],
        capture_output=True, text=True, env={**os.environ, "PYTHONPATH": paths}, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.startswith("pipeline: the plug-in broken = no_such_module:STAGE cannot be loaded: ")
