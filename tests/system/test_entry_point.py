"""The command in a process of its own: speed of --help, stdout and stderr, exit codes."""

import json
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from semidense.pipeline.results.result import Result
from tests.tiny import TRAINED

Command = Callable[..., Any]
HELP_SECONDS = 0.5


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"], ["cache", "--help"]], ids=" ".join)
def test_help_answers_at_once(command: Command, arguments: list[str]) -> None:
    command(*arguments)  # bytecode
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    ran = command(*arguments)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert ran.code == 0
    assert "Usage: pipeline" in ran.out
    assert after.ru_utime - before.ru_utime < HELP_SECONDS


def test_help_loads_nothing_heavy(project: Path) -> None:
    code = (
        "import sys\nfrom semidense.pipeline.cli.main import app\n"
        "try:\n    app(['run', '--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'torch', 'dask', 'zarr', 'xarray', 'numba', 'matplotlib', 'skimage'}\n"
        "print('loaded', sorted(heavy & set(sys.modules)))"
    )
    ran = subprocess.run([sys.executable, "-c", code], cwd=project, capture_output=True, text=True, check=True)
    assert ran.stdout.splitlines()[-1] == "loaded []"


def test_the_installed_command_is_this_one() -> None:
    installed = Path(sys.executable).with_name("pipeline")
    if not installed.is_file():
        pytest.skip("the package is not installed in this environment: pip install -e .")
    ran = subprocess.run([installed, "--help"], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert "Usage: pipeline" in ran.stdout


@pytest.mark.parametrize(("arguments", "code"), [(["--version"], 0), (["runn"], 2)], ids=["a result", "a mistake"])
def test_the_process_ends_with_the_command(project: Path, arguments: list[str], code: int) -> None:
    """What was asked to be done at the end is done, and nothing is dismantled."""
    script = (
        "import atexit, sys\nfrom semidense.pipeline.cli.main import command\n"
        "class Heavy:\n    def __del__(self): print('dismantled')\n"
        "heavy = Heavy()\natexit.register(print, 'asked for')\ncommand()"
    )
    ran = subprocess.run([sys.executable, "-c", script, *arguments], cwd=project, capture_output=True, text=True)
    assert ran.returncode == code
    assert ran.stdout.splitlines()[-1] == "asked for"


def test_a_closed_output_is_one_line(project: Path) -> None:
    script = "import os, sys; os.close(1); os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
    command = [sys.executable, "-c", script, "-m", "semidense.pipeline", "status"]
    ran = subprocess.run(command, cwd=project, capture_output=True, text=True)
    assert (ran.returncode, ran.stderr.count("\n")) == (2, 1)
    assert "standard output is closed" in ran.stderr


def test_results_go_to_stdout_and_notes_to_stderr(command: Command, trained: Result, tmp_path: Path) -> None:
    ran = command("run", *TRAINED, "--cache", trained.store.root, cwd=tmp_path)
    assert ran.code == 0
    assert ran.out.splitlines()[-1] == "reused 27 products, made nothing"
    assert {line.split(":")[0] for line in ran.err.splitlines()} == {"note"}
    assert list(tmp_path.iterdir()) == [], "nothing is written where one stands"


def test_progress_of_a_run_stays_out_of_json(command: Command, own_cache: Path) -> None:
    ran = command("run", *TRAINED, "--set", "semidense.R=0", "--cache", own_cache, "--json")
    assert ran.code == 0, ran.err
    assert set(json.loads(ran.out)) == {"steps", "metrics", "files"}
    assert [step["state"] for step in json.loads(ran.out)["steps"]].count("made") == 2


def test_a_mistake_is_one_line_and_exit_code_2(command: Command, tmp_path: Path) -> None:
    ran = command("run", "motorcycl", "--cache", tmp_path / "cache")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.count("\n") == 1
    assert not (tmp_path / "cache").exists()


def test_a_reader_that_has_seen_enough_is_no_fault(start: Callable[..., Any], trained: Result) -> None:
    process = start("cache", "ls", "--cache", trained.store.root)
    process.stdout.close()
    assert "Traceback" not in process.stderr.read()
    process.wait(timeout=30)


def test_a_plan_that_is_all_hits_loads_no_network(trained: Result, project: Path) -> None:
    code = (
        "import sys\nfrom semidense.pipeline.cli.main import app\n"
        "try:\n    app(sys.argv[1:])\nexcept SystemExit:\n    pass\n"
        "print('loaded', sorted({'torch', 'numba', 'dask', 'matplotlib'} & set(sys.modules)))"
    )
    arguments = ["status", *TRAINED, "--cache", str(trained.store.root)]
    ran = subprocess.run(
        [sys.executable, "-c", code, *arguments], cwd=project, capture_output=True, text=True, check=True
    )
    assert ran.stdout.splitlines()[-1] == "loaded []"
