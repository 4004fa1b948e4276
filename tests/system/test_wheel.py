"""The wheel lives beside other distributions that own a folder of one of our four names."""

import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

from tests.tiny import TEST_ONLY

OTHERS = {"datasets/__init__.py": "WHOSE = 'another library'\n", "cache/__init__.py": "WHOSE = 'a third one'\n"}
SETUP = "from setuptools import setup\nsetup(name='others', version='1', packages=['datasets', 'cache'])\n"


def _run(*command: object, cwd: Path) -> str:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def _wheel(source: Path, target: Path) -> Path:
    options = ("--no-deps", "--no-build-isolation", "--quiet", "--disable-pip-version-check")
    _run(sys.executable, "-m", "pip", "wheel", *options, "--wheel-dir", target, source, cwd=target)
    (found,) = target.glob("*.whl")
    return found


@pytest.fixture(scope="module")
def installed(project: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with our wheel beside another distribution; dependencies come from the one of the tests."""
    folder = tmp_path_factory.mktemp("wheel")
    copy, other = folder / "copy", folder / "other"
    copy.mkdir()
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(project / name, copy)
    for name in ("pipeline", "stages", "datasets", "cache"):
        shutil.copytree(project / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name, text in {**OTHERS, "setup.py": SETUP}.items():
        (other / name).parent.mkdir(parents=True, exist_ok=True)
        (other / name).write_text(text)
    environment = folder / "environment"
    venv.create(environment, with_pip=False, symlinks=True)
    site = next(environment.glob("lib/python*/site-packages"))
    for index, source in enumerate((other, copy)):
        wheels = folder / f"wheels{index}"
        wheels.mkdir()
        install = ("install", "--no-deps", "--quiet", "--disable-pip-version-check", "--target", site)
        _run(sys.executable, "-m", "pip", *install, _wheel(source, wheels), cwd=folder)
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib"))
    return environment


def test_another_distribution_keeps_its_files(installed: Path) -> None:
    site = next(installed.glob("lib/python*/site-packages"))
    assert {name: (site / name).read_text() for name in OTHERS} == OTHERS
    assert sorted(path.name for path in (site / "semidense").iterdir()) == ["cache", "datasets", "pipeline", "stages"]


def test_a_run_works_from_a_folder_that_has_our_names(installed: Path, tmp_path: Path) -> None:
    for name in ("pipeline", "stages", "datasets", "cache"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise ImportError('a folder of the user')\n")
    python = installed / "bin" / "python"
    where = _run(python, "-c", "import semidense.pipeline as p; print(p.__file__)", cwd=tmp_path)
    assert where.startswith(str(installed)), "the wheel, not the checkout"
    arguments = ("run", TEST_ONLY, "--upto", "channels", "--cache", tmp_path / "results")
    assert "made 1 images" in _run(python, "-m", "semidense.pipeline", *arguments, cwd=tmp_path)


def test_a_folder_with_our_names_does_not_hide_an_editable_install(tmp_path: Path) -> None:
    (tmp_path / "datasets").mkdir()
    (tmp_path / "datasets" / "__init__.py").write_text("raise ImportError('a folder of the user')\n")
    assert _run(sys.executable, "-m", "semidense.pipeline", "--version", cwd=tmp_path).startswith("pipeline ")
