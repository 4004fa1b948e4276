"""Where settings come from: ``--mode``, ``--config``, ``$PIPELINE_CONFIG``, ``./pipeline.toml``, an exported run."""

import json
from pathlib import Path

import pytest

from semidense.pipeline.cli.options import chosen, chosen_preset, config_file
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.errors import UsageError


def test_the_mode_wins_over_a_setting() -> None:
    settings = chosen(["costvolume.mode=guided", "semidense.R=0.5"], "fast")
    config = Config.load(None, settings)
    assert (config.section("costvolume").mode, config.section("semidense").R) == ("fast", 0.5)
    assert chosen(None, None) == ()


def test_an_unknown_mode_is_one_line() -> None:
    with pytest.raises(UsageError, match=r"costvolume\.mode = 'quick'"):
        Config.load(None, chosen(None, "quick"))


def test_the_nearest_source_of_settings_wins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PIPELINE_CONFIG", raising=False)
    assert config_file(None) is None
    Path("pipeline.toml").touch()
    assert config_file(None) == Path("pipeline.toml")
    monkeypatch.setenv("PIPELINE_CONFIG", "elsewhere.toml")
    assert config_file(None) == Path("elsewhere.toml")
    assert config_file(Path("mine.toml")) == Path("mine.toml")


def exported(tmp_path: Path, *settings: dict[str, dict[str, object]]) -> Path:
    path = tmp_path / "config.json"
    path.write_text(json.dumps({"preset": "robust", "configuration": [{"sections": each} for each in settings]}))
    return path


def test_an_exported_configuration_is_taken_as_it_was_asked_for(tmp_path: Path) -> None:
    asked = ["costvolume.d_max=70", "costvolume.mode=guided", "semidense.R=0", "use.confidence=null"]
    config = Config.load(None, asked, "robust")
    again = Config.load(exported(tmp_path, config.to_dict()), preset="robust")
    assert again == config
    assert (again.section("costvolume").d_max, again.choice("use", "confidence")) == (70, None)


def test_a_name_that_an_exported_configuration_must_not_have_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"semidense has no setting 'RR'"):
        Config.load(exported(tmp_path, {"semidense": {"RR": 0.5}}))


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"configuration": [3]}', '{"configuration": []}'])
def test_another_json_file_is_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "other.json").write_text(text)
    with pytest.raises(UsageError, match=r"configuration .*other\.json: it"):
        Config.load(tmp_path / "other.json")


def test_several_sets_of_settings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="2 sets of settings that differ"):
        Config.load(exported(tmp_path, {"semidense": {"R": 0.1}}, {"semidense": {"R": 0.2}}))


def test_settings_of_a_stage_that_stands_in_for_another_are_kept(tmp_path: Path) -> None:
    made = {"use": {"disparity": "aggregated"}, "aggregated": {"paths": 16}}
    config = Config.load(exported(tmp_path, made))
    assert (config.choice("use", "disparity"), config.section("aggregated").paths) == ("aggregated", 16)


def test_the_preset_of_an_exported_run_is_the_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PIPELINE_CONFIG", raising=False)
    assert (chosen_preset(None, None), chosen_preset(None, None, "robust")) == ("paper", "robust")
    file = exported(tmp_path, {})
    assert (chosen_preset(None, file), chosen_preset("paper", file)) == ("robust", "paper")
    Path("other.json").write_text("[]")
    Path("pipeline.toml").touch()
    assert [chosen_preset(None, each) for each in (Path("other.json"), Path("none.json"), None)] == ["paper"] * 3
