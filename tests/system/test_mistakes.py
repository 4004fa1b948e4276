"""A user's mistake is one clear line on stderr, exit code 2, and nothing left behind."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.tiny import TEST_ONLY

Invoke = Callable[..., Any]


def refused(ran: Any, *words: str) -> None:  # noqa: ANN401
    """Check that a command said one line about what is wrong, and nothing else."""
    assert (ran.code, ran.out) == (2, ""), ran
    assert ran.err.startswith("pipeline: ")
    assert ran.err.count("\n") == 1, ran.err
    assert [word for word in words if word not in ran.err] == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        pytest.param(["run", "motorcycl"], ["motorcycl", "did you mean motorcycle?"], id="no such dataset"),
        pytest.param(["run", "middlebury:/none/here"], ["/none/here"], id="no such folder"),
        pytest.param(["run", "middlebury:"], ["middlebury:DIR"], id="no folder given"),
        pytest.param(["run", "synthetic:hight=3"], ["hight", "height"], id="unknown option of a dataset"),
        pytest.param(["run", "synthetic:height=1"], ["height=1", "16"], id="option out of its range"),
        pytest.param(["run", "synthetic", "--scene", "test-9"], ["test-9", "did you mean test-"], id="no such scene"),
        pytest.param(["run", "--upto", "disparities"], ["did you mean disparity?"], id="no such product"),
        pytest.param(["run", "--force", "metric"], ["did you mean metrics?"], id="no such product to force"),
        pytest.param(["explain", "costvol", "synthetic"], ["costvol'", "costvolume"], id="no such product to explain"),
        pytest.param(["run", "--set", "channels.window=3"], ["rank_window"], id="no such setting"),
        pytest.param(["run", "--set", "semidense.R=1.5"], ["semidense.R = 1.5", "1"], id="R above 1"),
        pytest.param(["run", "--set", "semidense.R=-1"], ["semidense.R = -1"], id="R below 0"),
        pytest.param(["run", "--set", "semidense.R"], ["section.field=value"], id="a setting without a value"),
        pytest.param(["sweep", "--R", "0:2:0.5"], ["[0, 1]", "1.5"], id="a sweep beyond 1"),
        pytest.param(["sweep", "--R", "often"], ["'often'", "first:last:step"], id="a sweep over nothing"),
        pytest.param(["sweep", "--set", "channels.use"], ["section.field=value"], id="a sweep without values"),
        pytest.param(["run", "--config", "/none/c.toml"], ["/none/c.toml", "No such file"], id="no such configuration"),
        pytest.param(["run", TEST_ONLY, "--train"], ["no training scene", "training.dataset"], id="nothing to learn"),
        pytest.param(["run", TEST_ONLY, "--set", "costvolume.d_min=9"], ["d_max 8", "d_min 9"], id="an empty range"),
        pytest.param(["run", TEST_ONLY, "--set", "costvolume.d_max=999999999"], ["80 px wide"], id="an endless range"),
        pytest.param(["inspect", "disparity", TEST_ONLY], ["not cached", "--upto disparity"], id="not made"),
        pytest.param(["data", "list", "kiti2015:/x"], ["kitti2015"], id="no such dataset to list"),
    ],
)  # fmt: skip
def test_a_wrong_request_is_one_line(
    invoke: Invoke, weights: Path, tmp_path: Path, arguments: list[str], words: list[str]
) -> None:
    where = [] if arguments[0] == "data" else ["--cache", str(tmp_path / "cache")]
    refused(invoke(*arguments, *where), *words)
    assert not (tmp_path / "cache").exists()


@pytest.fixture
def pair(make_pair: Callable[[Path], Path], tmp_path: Path) -> Path:
    return make_pair(tmp_path / "pair")


def save(path: Path, shape: tuple[int, ...]) -> None:
    Image.fromarray(np.zeros(shape, np.uint8)).save(path)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        pytest.param(lambda pair: (pair / "im1.png").unlink(), ["im1.png"], id="a view is missing"),
        pytest.param(lambda pair: (pair / "im0.png").write_bytes(b""), ["im0.png"], id="a view is empty"),
        pytest.param(lambda pair: (pair / "im1.png").write_bytes(b"hello" * 99), ["im1.png"], id="a view is no image"),
        pytest.param(
            lambda pair: os.truncate(pair / "im1.png", (pair / "im1.png").stat().st_size // 2),
            ["im1.png"],
            id="a view is truncated",
        ),
        pytest.param(lambda pair: save(pair / "im1.png", (40, 47, 3)), ["40 x 47", "40 x 48"], id="sizes that differ"),
        pytest.param(lambda pair: (pair / "calib.txt").write_text("cam0=x"), ["calib.txt"], id="a broken calibration"),
        pytest.param(lambda pair: (pair / "calib.txt").write_bytes(b"\0\xff"), ["calib.txt"], id="no text"),
    ],
)
def test_a_bad_scene_is_one_line_and_leaves_nothing(
    invoke: Invoke, pair: Path, tmp_path: Path, damage: Callable[[Path], object], words: list[str]
) -> None:
    damage(pair)
    cache = tmp_path / "cache"
    refused(invoke("run", f"middlebury:{pair}", "--upto", "channels", "--cache", cache), *words)
    assert not list(cache.glob("records/*/*"))
    assert not list(cache.glob("drafts/*"))


def test_a_cache_that_is_a_file_is_refused(invoke: Invoke, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    refused(invoke("run", TEST_ONLY, "--upto", "images", "--cache", tmp_path / "file"), "cache", str(tmp_path / "file"))
    assert (tmp_path / "file").read_text() == "mine"


WITHOUT_ROOT = """
import os, sys
if os.getuid() == 0 and sys.argv[-1] != "again":
    import ctypes
    ctypes.CDLL(None).prctl(24, 1)  # PR_CAPBSET_DROP, CAP_DAC_OVERRIDE: permissions now hold for root too
    os.execv(sys.executable, [*sys.orig_argv, "again"])
if sys.argv[-1] == "again":
    sys.argv.pop()
from semidense.pipeline.cli.main import command
command()
"""


def test_a_cache_that_cannot_be_written_is_refused(tmp_path: Path, project: Path) -> None:
    cache = tmp_path / "cache"
    cache.mkdir()
    cache.chmod(0o500)
    command = [sys.executable, "-c", WITHOUT_ROOT, "run", TEST_ONLY, "--upto", "images", "--cache", str(cache)]
    environment = {**os.environ, "PYTHONPATH": str(project)}
    ran = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60, check=False)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr.count("\n") == 1
    assert "cannot write to the cache" in ran.stderr
    assert list(cache.iterdir()) == []


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense"])
def test_a_scheduler_that_does_not_answer_is_refused(
    invoke: Invoke, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    import distributed

    class Impatient(distributed.Client):
        def __init__(self, address: str, **options: object) -> None:
            super().__init__(address, **{**options, "timeout": "0.5s"})

    monkeypatch.setattr(distributed, "Client", Impatient)
    cache = tmp_path / "cache"
    arguments = ["run", TEST_ONLY, "--upto", "images", "--cache", cache]
    refused(invoke(*arguments, "--scheduler", address), "no Dask scheduler answers", address)
    assert not list(cache.glob("drafts/*"))


@pytest.mark.parametrize(
    "arguments",
    [["runn"], ["run", "--nope"], ["run", "--workers", "0"], ["run", "a", "b"], ["cache"], ["sweep", "--R"]],
    ids=" ".join,
)
def test_a_command_line_that_is_none_exits_with_2_and_writes_to_stderr(invoke: Invoke, arguments: list[str]) -> None:
    ran = invoke(*arguments)
    assert ran.code == 2
    assert "Traceback" not in ran.err
    assert ran.out == "" or arguments == ["cache"]


def test_a_fault_of_the_program_is_a_traceback_and_exit_code_1(tmp_path: Path, project: Path) -> None:
    code = (
        "import sys\n"
        "from semidense.pipeline.cli import main\n"
        "from semidense.pipeline.plan import images_and_truth\n"
        "def broken(*_): raise RuntimeError('bang')\n"
        "images_and_truth.read_images = broken\n"
        f"sys.argv = ['pipeline', 'run', {TEST_ONLY!r}, '--upto', 'images', '--cache', {str(tmp_path / 'cache')!r}]\n"
        "main.main()"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=project, capture_output=True, text=True, timeout=60, check=False
    )
    assert (ran.returncode, ran.stdout) == (1, "")
    line = "semidense.pipeline.plan.errors.StageFailed: images of test-0: RuntimeError: bang"
    assert ran.stderr.splitlines()[-1] == line
    assert "RuntimeError: bang" in ran.stderr, "the cause is told"
    assert list((tmp_path / "cache" / "drafts").iterdir()) == []
