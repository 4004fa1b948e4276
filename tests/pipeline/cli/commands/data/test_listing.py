import json
from pathlib import Path

import pytest

from semidense.datasets import DatasetError, describe
from semidense.pipeline.cli.commands.data.listing import list_datasets, list_scenes


def test_every_dataset_is_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    list_datasets(tmp_path, as_json=True)
    found = json.loads(capsys.readouterr().out)["datasets"]
    assert [(row["dataset"], row["about"]) for row in found] == describe()
    list_datasets(tmp_path, as_json=False)
    out = capsys.readouterr().out
    assert all(pattern in out for pattern, _ in describe())
    fetched = {line.split()[0]: line.split()[2:4] for line in out.splitlines() if " no " in line}
    assert fetched["kitti2015"] == ["1.6", "GB"]
    assert fetched["eth3d"][0] == "unknown"


def test_scenes_are_listed_with_what_is_known(capsys: pytest.CaptureFixture[str]) -> None:
    list_scenes("synthetic:train=1,test=0", as_json=False)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines[1] == ["train-0", "96", "x", "128", "0..20", "train", "yes"]


def test_a_dataset_that_is_none_is_refused() -> None:
    with pytest.raises(DatasetError, match="did you mean synthetic"):
        list_scenes("sintetic", as_json=True)


def test_what_can_be_fetched_is_listed_with_whether_it_is_here(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "kitti2015").mkdir()
    (tmp_path / ".archives/eth3d/data").mkdir(parents=True)
    (tmp_path / ".archives/eth3d/data/two_view_training.7z.part").touch()
    list_datasets(tmp_path, as_json=True)
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)["publications"]}
    assert (rows["kitti2015"]["here"], rows["eth3d"]["here"], rows["middeval3-q"]["here"]) == ("yes", "in part", "no")
    assert rows["kitti2015"]["licence"] == "CC BY-NC-SA 3.0" and "CVPR 2015" in rows["kitti2015"]["cite"]
    assert rows["kitti2015"]["dataset"] == f"kitti2015:{tmp_path / 'kitti2015'}"
    assert {name for name, row in rows.items() if not row["confirmed"]} == {
        f"middlebury{year}{size}-grid" for year in (2005, 2006) for size in ("", "-half", "-full")
    }
    list_datasets(tmp_path, as_json=False)
    out = capsys.readouterr().out
    assert "1.6 GB" in out and "not confirmed" in out
