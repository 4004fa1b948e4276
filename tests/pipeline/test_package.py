import subprocess
import sys
from pathlib import Path

import pytest

from semidense import pipeline


@pytest.mark.parametrize("name", pipeline.__all__)
def test_every_verb_is_there(name: str) -> None:
    assert callable(getattr(pipeline, name))


def test_another_name_is_none() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'walk'"):
        _ = pipeline.walk


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        pytest.param("pipeline", ["numpy", "torch", "dask", "zarr", "xarray", "pydantic"], id="the package"),
        pytest.param(
            "semidense.pipeline.cli.main",
            ["numpy", "torch", "dask", "zarr", "xarray", "pydantic"],
            id="the command line",
        ),
        pytest.param(
            "semidense.pipeline.api", ["torch", "dask", "zarr", "xarray", "numba", "matplotlib"], id="planning"
        ),
    ],
)
def test_importing_it_stays_light(module: str, heavy: list[str], project: Path) -> None:
    code = f"import sys, {module}; print(*sorted(set(sys.modules) & set({heavy!r})))"
    done = subprocess.run([sys.executable, "-c", code], cwd=project, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
