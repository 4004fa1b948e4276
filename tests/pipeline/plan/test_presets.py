from pathlib import Path

import pytest

from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.presets import DEFAULT, OWN_PAIRS, PRESETS


def test_the_paper_is_the_default_and_changes_nothing() -> None:
    assert DEFAULT == "paper"
    assert Config.load() == Config.load(preset="paper") == Config.load(settings=["semidense.R=0.9"])


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_is_what_its_settings_are(preset: str) -> None:
    assert Config.load(preset=preset) == Config.load(settings=PRESETS[preset])


def test_a_users_own_pairs_have_a_preset_that_exists() -> None:
    assert OWN_PAIRS in PRESETS


def test_robust_takes_aggregated_maps_of_both_views() -> None:
    config = Config.load(preset="robust")
    assert config.choice("use", "disparity") == "aggregated"
    assert config.choice("use", "right_disparity") == "right_aggregated"
    assert config.choice("use", "confidence") == "evidence_confidence"


def test_a_file_wins_over_the_preset_and_a_setting_over_the_file(tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    file.write_text('[costvolume]\nmode = "guided"\nvotes = 30\n[aggregated]\npaths = 16\n')
    config = Config.load(file, ["costvolume.votes=31"], "robust").to_dict()
    assert (config["costvolume"]["mode"], config["costvolume"]["votes"]) == ("guided", 31)
    assert config["aggregated"]["paths"] == 16 and config["use"]["disparity"] == "aggregated"


def test_an_unknown_preset_is_refused_with_the_nearest() -> None:
    with pytest.raises(UsageError, match="no preset 'robst'; did you mean robust"):
        Config.load(preset="robst")
