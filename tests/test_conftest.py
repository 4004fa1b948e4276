"""CI fails on a skip that nobody expects."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import PROJECT

TEST = "import pytest\n\ndef test_it():\n    pytest.skip({reason!r})\n"


@pytest.mark.parametrize(
    ("reason", "ci", "code"),
    [
        pytest.param("no real data in /x; set STEREO_DATA", "true", 0, id="expected"),
        pytest.param("there is no Chromium on this machine", "true", 1, id="unexpected"),
        pytest.param("there is no Chromium on this machine", "", 0, id="outside of CI"),
    ],
)
def test_an_unexpected_skip_fails_a_run_of_ci(reason: str, ci: str, code: int, tmp_path: Path) -> None:
    (tmp_path / "test_it.py").write_text(TEST.format(reason=reason))
    (tmp_path / "conftest.py").write_text("from tests.conftest import pytest_sessionfinish\n")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", tmp_path, tmp_path],
        cwd=tmp_path, env={**os.environ, "CI": ci, "PYTHONPATH": os.pathsep.join([str(PROJECT), *sys.path])},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == code, done.stdout
    assert ("unexpected skip in CI" in done.stdout) == (code == 1)
