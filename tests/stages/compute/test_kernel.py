import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from semidense import stages
from semidense.stages.compute import kernel as module
from semidense.stages.compute.kernel import kernel


@kernel
def _total(values: np.ndarray) -> float:
    total = 0.0
    for value in values:
        total += value
    return total


def test_compiles_a_loop() -> None:
    assert _total(np.array([1.0, 2.0, 4.0])) == 7.0


def test_keeps_ieee_rules() -> None:
    assert np.isnan(_total(np.array([1.0, np.nan])))
    assert _total(np.array([1e16, 1.0, -1e16])) == 0.0, "sums are not reordered"


LOOP = """
import numpy as np
from semidense.stages.compute.kernel import kernel
from made.{source} import {name}

@kernel
def filled(values: np.ndarray) -> None:
    for i in range(len(values)):
        values[i] = {call}

made = np.zeros(2)
filled(made)
print(made[0])
"""
HELPER = (
    "from semidense.stages.compute.kernel import inlined\nfrom made.constants import STEP\n"
    "@inlined\ndef helper(i):\n    return {}\n"
)


@pytest.mark.parametrize(
    ("loop", "changed", "before", "after"),
    [
        pytest.param(
            LOOP.format(source="helpers", name="helper", call="helper(i)"),
            "helpers.py", HELPER.format("STEP"), HELPER.format("STEP + 1"), id="a helper",
        ),
        pytest.param(
            LOOP.format(source="constants", name="STEP", call="STEP"),
            "constants.py", "STEP = 1.0", "STEP = 2.0", id="a constant",
        ),
        pytest.param(
            LOOP.replace("from made.{source} import {name}", "import made.constants\nSTEP = made.constants.STEP")
            .format(call="STEP"),
            "constants.py", "STEP = 1.0", "STEP = 2.0", id="a constant of an imported module",
        ),
        pytest.param(
            LOOP.replace("from made.{source} import {name}", "from made import constants\nSTEP = constants.STEP")
            .format(call="STEP"),
            "constants.py", "STEP = 1.0", "STEP = 2.0", id="a constant of a module imported from its package",
        ),
        pytest.param(
            LOOP.format(source="helpers", name="helper", call="helper(i)"),
            "constants.py", "STEP = 1.0", "STEP = 2.0", id="a constant of a helper",
        ),
    ],
)  # fmt: skip
def test_a_change_in_another_module_is_compiled(
    loop: str, changed: str, before: str, after: str, tmp_path: Path
) -> None:
    """Numba looks at the file of the loop alone, and would go on with the old machine code."""
    package = tmp_path / "made"
    package.mkdir()
    for name, text in (("constants.py", "STEP = 1.0"), ("helpers.py", HELPER.format("STEP")), ("loop.py", loop)):
        (package / name).write_text(text)
    seen = []
    for text in (before, before, after):
        (package / changed).write_text(text)
        paths = os.pathsep.join([str(tmp_path), str(Path(stages.__file__).parents[1])])
        run = subprocess.run(
            [sys.executable, "-Bc", "import made.loop"], env={**os.environ, "PYTHONPATH": paths}, cwd=tmp_path,
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        seen.append(float(run.stdout))
    assert seen == [1.0, 1.0, 2.0]
    assert len([*package.rglob("*.nbi")]) == 2, "an unchanged one is read from disk"


def test_a_kernel_of_another_package_knows_the_helpers_it_takes_from_this_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Such as those of the tests, which would go on with the old machine code, and pass."""
    usual, read = module._digest(__name__), module._source
    changed = {"semidense.stages.compute.kernel": (b"changed", ())}
    monkeypatch.setattr(module, "_source", lambda name: changed.get(name) or read(name))
    assert module._digest(__name__) != usual
