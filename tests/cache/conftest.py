"""A small result that can be checked by hand, and ways to run code that is to be killed."""

import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from semidense.cache import Draft, Entry, Recipe, Store

PROJECT = Path(__file__).parents[2]
VALUES = np.array([[0, 1, np.nan], [3, 4, 5], [0, 0, 0]], dtype=np.float32)
RECIPE = Recipe("square", code={"squares": "1f"}, params={"n": 3}, inputs={"images": "ab"}, environment={"zarr": "3"})
LABEL = {"product": "square", "scene": "Teddy"}

WITHOUT_ROOT = """
import os, sys
if os.getuid() == 0 and sys.argv[-1] != "again":
    import ctypes
    ctypes.CDLL(None).prctl(24, 1)  # PR_CAPBSET_DROP, CAP_DAC_OVERRIDE: permissions now hold for root too
    os.execv(sys.executable, [*sys.orig_argv, "again"])
"""
PRELUDE = f"""
import os, signal, sys
from pathlib import Path
import numpy as np
from semidense.cache import Recipe, Store
from semidense.cache.entries import draft as drafting, publish, quarantine
recipe = Recipe(**{RECIPE.to_dict()!r})
values = np.array([[0, 1, np.nan], [3, 4, 5], [0, 0, 0]], dtype=np.float32)

def make(root, values=values):
    with Store(root).begin(recipe, {LABEL!r}) as draft:
        draft.create_array("map", (3, 3), "float32", (2, 3), ("y", "x"), {{"units": "px"}}, fill_value=0)
        draft.write("map", (slice(0, 2), slice(0, 3)), values[:2])
        draft.write("map", (slice(2, 3), slice(0, 3)), values[2:])
        return draft.publish(1.5, {{}})

def die(*_):
    os.kill(os.getpid(), signal.SIGKILL)

def in_child(work):
    pid = os.fork()
    if not pid:
        try:
            work()
        except BaseException as error:
            print(type(error).__name__, error, file=sys.stderr, flush=True)
            os._exit(1)
        os._exit(0)
    return pid

def code(pid):
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
"""


def fill(draft: Draft, values: np.ndarray = VALUES) -> None:
    """Write the small result: two chunks, the last of them all fill value."""
    draft.create_array("map", (3, 3), "float32", (2, 3), ("y", "x"), {"units": "px"}, fill_value=0)
    draft.write("map", (slice(0, 2), slice(0, 3)), values[:2])
    draft.write("map", (slice(2, 3), slice(0, 3)), values[2:])


Make = Callable[..., Entry]


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "cache")


@pytest.fixture
def recipe() -> Recipe:
    return RECIPE


@pytest.fixture
def values() -> np.ndarray:
    return VALUES


@pytest.fixture
def filled() -> Callable[..., None]:
    return fill


@pytest.fixture
def make() -> Make:
    """Publish the small result; parameters of the recipe by keyword."""

    def publish(store: Store, values: np.ndarray = VALUES, label: Mapping[str, str] = LABEL, **params: object) -> Entry:
        recipe = Recipe(RECIPE.stage, RECIPE.code, {**RECIPE.params, **params}, RECIPE.inputs, RECIPE.environment)
        with store.begin(recipe, label) as draft:
            fill(draft, values)
            return draft.publish(1.5, {"version": "0"})

    return publish


@pytest.fixture(scope="session")
def run_script() -> Callable[..., str]:
    """Run Python code after ``PRELUDE`` in a process of its own; return what it prints."""

    def run(code: str, *arguments: object, root: bool = True) -> str:
        prelude = PRELUDE if root else WITHOUT_ROOT + PRELUDE
        command = [sys.executable, "-c", prelude + code, *map(str, arguments)]
        path = os.pathsep.join([str(PROJECT), os.environ.get("PYTHONPATH", "")])
        environment = {**os.environ, "PYTHONPATH": path}
        done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run
