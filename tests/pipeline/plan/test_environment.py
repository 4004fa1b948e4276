from pathlib import Path

import numpy as np
import pytest

from semidense.cache import Entry, Recipe, Store
from semidense.pipeline.plan.environment import former_version

HERE = {"semidense.stages": "1f", "semidense.stages.stage": "2f"}


def _entry(store: Store, code: dict[str, str], versions: dict[str, str]) -> Entry:
    with store.begin(Recipe("toy", code, {}, {}, {}), {"product": "toy"}) as draft:
        draft.create_array("a", (1,), "int8", (1,), ("n",), {})
        draft.write("a", (slice(None),), np.zeros(1, np.int8))
        return draft.publish(0.0, {"versions": versions})


@pytest.mark.parametrize(
    ("code", "former"),
    [
        pytest.param(HERE, None, id="ours"),
        pytest.param({**HERE, "a_plug_in.stage": "3f"}, None, id="a package that is not installed now may come back"),
        pytest.param({"stages.stage": "2f"}, "0.1.0", id="before the namespace"),
        pytest.param({**HERE, "semidense.stages.gone": "3f"}, "0.1.0", id="a module that is gone"),
    ],
)
def test_an_entry_of_another_version_is_recognised(code: dict[str, str], former: str | None, tmp_path: Path) -> None:
    entry = _entry(Store(tmp_path / "cache"), code, {"semidense-stereo": "0.1.0"})
    assert former_version(entry) == former


def test_an_entry_that_does_not_tell_its_version_is_recognised_too(tmp_path: Path) -> None:
    assert former_version(_entry(Store(tmp_path / "cache"), {"cache": "1f"}, {})) == "unknown"


def test_an_entry_of_a_later_version_is_left_to_it(tmp_path: Path) -> None:
    code = {**HERE, "semidense.stages.transforms.tomorrow": "3f"}
    assert former_version(_entry(Store(tmp_path / "cache"), code, {"semidense-stereo": "99.0.1"})) is None
