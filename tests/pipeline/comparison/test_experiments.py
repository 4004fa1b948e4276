from pathlib import Path
from typing import Any

import pytest

from semidense.datasets import open_dataset
from semidense.pipeline.api import Task
from semidense.pipeline.comparison import experiments
from semidense.pipeline.comparison.prepared import Prepared
from semidense.pipeline.plan.errors import UsageError
from tests.tiny import TEST_ONLY


@pytest.fixture
def compare(monkeypatch: pytest.MonkeyPatch) -> Any:  # noqa: ANN401
    """The verb, which returns what it would make."""
    monkeypatch.setattr(experiments, "carry_out_comparison", lambda prepared, **_: prepared)
    return experiments.compare


@pytest.mark.parametrize(
    "dataset",
    [
        pytest.param(TEST_ONLY, id="a specification"),
        pytest.param(open_dataset(TEST_ONLY), id="an opened one"),
        pytest.param(Task(TEST_ONLY), id="a task"),
    ],
)
def test_it_takes_what_a_run_takes(compare: Any, tmp_path: Path, dataset: object) -> None:  # noqa: ANN401
    found: Prepared = compare(dataset, "raw", cache=tmp_path, settings={"semidense.R": 0.5}, scenes="test-0")
    assert (found.task.cache, found.task.settings) == (tmp_path, ("semidense.R=0.5",))
    assert [scene.name for scene in found.own.dataset.scenes] == ["test-0"]
    assert found.own.upto == "semidense"


def test_a_folder_is_a_dataset(compare: Any, make_pair: Any, tmp_path: Path) -> None:  # noqa: ANN401
    with pytest.raises(UsageError, match="no scene has a ground truth"):
        compare(make_pair(tmp_path / "pair"))


def test_one_experiment_and_one_matcher_are_named_by_a_text(compare: Any) -> None:  # noqa: ANN401
    found: Prepared = compare(TEST_ONLY, "auc", without="o1")
    assert found.experiments == ("auc",)
    assert {"method": "O1", "why": "left out on request"} in found.unavailable
    with pytest.raises(UsageError, match="no experiment 'auk'; did you mean auc"):
        compare(TEST_ONLY, "auk")
