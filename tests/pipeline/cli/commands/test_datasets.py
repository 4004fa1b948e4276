import json

import pytest

from semidense.datasets import DatasetError, describe
from semidense.pipeline.cli.commands.show import list_datasets, list_scenes


def test_every_dataset_is_listed(capsys: pytest.CaptureFixture[str]) -> None:
    list_datasets(as_json=True)
    found = json.loads(capsys.readouterr().out)["datasets"]
    assert [(row["dataset"], row["about"]) for row in found] == describe()
    list_datasets(as_json=False)
    out = capsys.readouterr().out
    assert all(pattern in out for pattern, _ in describe())


def test_scenes_are_listed_with_what_is_known(capsys: pytest.CaptureFixture[str]) -> None:
    list_scenes("synthetic:train=1,test=0", as_json=False)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines[1] == ["train-0", "96", "x", "128", "0..20", "train", "yes"]


def test_a_dataset_that_is_none_is_refused() -> None:
    with pytest.raises(DatasetError, match="did you mean synthetic"):
        list_scenes("sintetic", as_json=True)
