import subprocess
import sys

import pytest

from semidense import datasets

HEAVY = {"skimage", "torch", "matplotlib", "scipy", "imageio"}


@pytest.mark.parametrize(
    "code, absent",
    [
        pytest.param("from semidense import datasets", HEAVY | {"numpy", "PIL"}, id="the package alone"),
        pytest.param(
            "from semidense import datasets; datasets.DatasetError", HEAVY | {"numpy", "PIL"}, id="the errors"
        ),
        pytest.param(
            "from semidense import datasets; datasets.describe()", HEAVY | {"PIL"}, id="listing the specifications"
        ),
        pytest.param(
            "from semidense import datasets; datasets.open_dataset('motorcycle').scenes[0]", HEAVY, id="a scene, listed"
        ),
        pytest.param(
            "from semidense import datasets; datasets.open_dataset('motorcycle').scenes[0].load()",
            HEAVY - {"imageio"},
            id="a scene, its images decoded",
        ),
    ],
)
def test_imports_nothing_heavy(code: str, absent: set[str]) -> None:
    check = f"import sys; {code}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True)
    assert not absent & set(done.stdout.split())


@pytest.mark.parametrize("name", datasets.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(datasets, name) is not None
    assert name in dir(datasets)


def test_another_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = datasets.nothing


def test_a_name_is_the_one_that_is_documented_under_it() -> None:
    """Two modules may define the same name: a public one has one home."""
    assert datasets.describe.__module__ == "semidense.datasets.registry"
