"""Files of somebody else, and files that are read, are never replaced."""

import json
from pathlib import Path

import pytest

from semidense.pipeline.files.publishing import publishing, written_before
from semidense.pipeline.plan.errors import UsageError

RECORD = "record.json"


def publish(folder: Path, *names: str, inputs: tuple[Path, ...] = (), obsolete: tuple[str, ...] = ()) -> None:
    with publishing(folder, RECORD, inputs, obsolete) as draft:
        for name in names:
            (draft / name).parent.mkdir(exist_ok=True)
            (draft / name).write_text("new")
        (draft / RECORD).write_text(json.dumps({"files": list(names)}))


def test_files_of_an_earlier_command_are_replaced_and_obsolete_ones_deleted(tmp_path: Path) -> None:
    publish(tmp_path, "a", "scene/b", "c")
    (tmp_path / "a").write_text("old")
    publish(tmp_path, "a", obsolete=("c",))
    assert (tmp_path / "a").read_text() == "new"
    assert {path.name for path in tmp_path.rglob("*")} == {"a", "scene", "b", RECORD}


@pytest.mark.parametrize("name", ["a", RECORD])
def test_a_file_of_somebody_else_is_refused_and_nothing_is_written(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine")
    with pytest.raises(UsageError, match=f"{name}: this file was not written by"):
        publish(tmp_path, "0", "a")
    assert (tmp_path / name).read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_link_that_leads_nowhere_is_somebody_elses_too(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "away")
    with pytest.raises(UsageError, match="a: this file was not written by"):
        publish(tmp_path, "a")


def test_an_input_is_refused_even_if_an_earlier_command_wrote_it(tmp_path: Path) -> None:
    publish(tmp_path / "out", "a")
    (tmp_path / "link").symlink_to(tmp_path / "out" / "a")
    with pytest.raises(UsageError, match="reads this file and would overwrite it"):
        publish(tmp_path / "out", "a", inputs=(tmp_path / "link",))


def test_a_hostile_record_lets_nothing_outside_the_folder_be_deleted(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "out" / RECORD).write_text(json.dumps({"files": ["../mine", "thesis"]}))
    (tmp_path / "out" / "thesis").write_text("mine")
    publish(tmp_path / "out", "a", obsolete=("b",))
    assert (tmp_path / "mine").exists()
    assert (tmp_path / "out" / "thesis").exists()


@pytest.mark.parametrize("text", ["", "[]", '{"files": 3}', '{"files": [3]}', "[" * 100_000])
def test_a_record_that_is_none_names_nothing(tmp_path: Path, text: str) -> None:
    (tmp_path / RECORD).write_text(text)
    assert written_before(tmp_path, RECORD) == set()


def test_files_of_a_command_that_was_cut_short_can_be_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replace = Path.replace

    def killed(self: Path, target: Path) -> Path:
        if target.name == "b":
            raise KeyboardInterrupt
        return replace(self, target)

    (tmp_path / RECORD).write_text(json.dumps({"files": [], "configuration": ["of another scene"]}))
    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", killed)
        with pytest.raises(KeyboardInterrupt):
            publish(tmp_path, "a", "b")
    record = json.loads((tmp_path / RECORD).read_text())
    assert record["unfinished"]
    assert record["configuration"] == ["of another scene"], "what it said of files that stay is not lost"
    publish(tmp_path, "a", "b")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b", RECORD]
