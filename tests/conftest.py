import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.tiny import NETS, SETTINGS, SPEC

if TYPE_CHECKING:  # the package is imported when it is used: most tests do without torch
    from semidense.pipeline.api import Task
    from semidense.pipeline.results.result import Result

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as where a shell starts the tests in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)

PROJECT = Path(__file__).parents[1]
EXPECTED_SKIPS = ("no real data in ", "this system has no /proc", "this machine makes no network namespaces")
"""How the reasons begin for which a test may be skipped in CI; any other is a failure there."""


def unexpected_skips(reports: Iterable[pytest.TestReport | pytest.CollectReport]) -> list[str]:
    """Return the test and the reason of each skip that CI does not expect."""
    reasons = {
        report.nodeid: report.longrepr[2].removeprefix("Skipped: ")
        for report in reports
        if isinstance(report.longrepr, tuple)
    }
    return [f"{test}: {reason}" for test, reason in reasons.items() if not reason.startswith(EXPECTED_SKIPS)]


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a run of CI that skipped what it should have run: a check that is left out quietly proves nothing."""
    terminal = session.config.pluginmanager.get_plugin("terminalreporter")
    if os.environ.get("CI") != "true" or terminal is None:
        return
    for told in unexpected_skips(terminal.stats.get("skipped", ())):
        terminal.write_line(f"unexpected skip in CI: {told}", red=True)
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


@dataclass(frozen=True)
class Ran:
    """What a command left: exit code, stdout, stderr."""

    code: int
    out: str
    err: str


@pytest.fixture(scope="session")
def project() -> Path:
    """The folder of the sources."""
    return PROJECT


@pytest.fixture(scope="session")
def trained(tmp_path_factory: pytest.TempPathFactory) -> "Result":
    """A whole run with training, in a cache that tests must not change."""
    from semidense.pipeline.api import Task, run

    return run(Task(SPEC, settings=SETTINGS, train=True, cache=tmp_path_factory.mktemp("trained") / "cache"))


@pytest.fixture(scope="session")
def trained_task(trained: "Result") -> "Task":
    """The task that ``trained`` carried out."""
    from semidense.pipeline.api import Task

    return Task(SPEC, settings=SETTINGS, train=True, cache=trained.store.root)


@pytest.fixture
def own_cache(trained: "Result", tmp_path: Path) -> Path:
    """A copy of the session's cache, to change."""
    return Path(shutil.copytree(trained.store.root, tmp_path / "cache"))


@pytest.fixture
def own_task(trained_task: "Task", own_cache: Path) -> "Task":
    """The task that ``trained`` carried out, on a cache to change."""
    return replace(trained_task, cache=own_cache)


@pytest.fixture
def weights(trained: "Result", tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of weights that stand in for those of the package."""
    from semidense.pipeline.plan import shipped_weights as shipped
    from semidense.stages.weights import save_weights

    folder = tmp_path / "weights"
    folder.mkdir()
    for product in NETS:
        dataset = trained.open(product)
        arrays = {name: dataset[name].values for name in ("parameters", "loss")}
        (folder / f"{product}.safetensors").write_bytes(save_weights(product, arrays, {}))
    monkeypatch.setattr(shipped, "weights_file", lambda name: folder / f"{name}.safetensors")
    shipped.weights_digest.cache_clear()
    yield folder
    shipped.weights_digest.cache_clear()


@pytest.fixture
def invoke(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Ran]]:
    """Run a command through the entry point, in this process."""
    from semidense.pipeline.cli.main import main

    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def run(*arguments: object) -> Ran:
        monkeypatch.setattr(sys, "argv", ["pipeline", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main()
        out, err = capsys.readouterr()
        return Ran(int(stop.value.code or 0), out, err)

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)


ENTRY = [sys.executable, "-c", "from semidense.pipeline.cli.main import command; command()"]


@pytest.fixture(scope="session")
def start() -> Callable[..., "subprocess.Popen[str]"]:
    """Start a command in a process of its own."""

    def popen(*arguments: object, sources: Path | None = None, cwd: Path | None = None) -> "subprocess.Popen[str]":
        own = {"PYTHONPATH": str(sources)} if sources else {}
        environment = {**os.environ, **own, "PYTHONSAFEPATH": "1"}
        command: Sequence[str] = [*ENTRY, *map(str, arguments)]
        pipe = subprocess.PIPE
        return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=environment, cwd=cwd)

    return popen


@pytest.fixture(scope="session")
def command(start: Callable[..., "subprocess.Popen[str]"]) -> Callable[..., Ran]:
    """Run a command in a process of its own."""

    def run(*arguments: object, **how: Path) -> Ran:
        process = start(*arguments, **how)
        out, err = process.communicate(timeout=120)
        return Ran(process.returncode, out, err)

    return run


@pytest.fixture(scope="session")
def make_pair() -> Callable[[Path], Path]:
    """Write a scene folder as Middlebury's: 40 x 48 px, 4 disparities, no truth."""
    import numpy as np
    from PIL import Image

    def write(folder: Path) -> Path:
        folder.mkdir(parents=True)
        wide = np.random.default_rng(0).integers(0, 255, (40, 50, 3), np.uint8)
        for name, view in (("im0.png", wide[:, :48]), ("im1.png", wide[:, 2:])):
            Image.fromarray(view).save(folder / name)
        lines = ("cam0=[100 0 24; 0 100 20; 0 0 1]", "cam1=[100 0 24; 0 100 20; 0 0 1]")
        (folder / "calib.txt").write_text(
            "\n".join((*lines, "doffs=0", "baseline=50", "width=48", "height=40", "ndisp=4", ""))
        )
        return folder

    return write
