from pathlib import Path

import pytest
from pydantic import BaseModel

from semidense.pipeline.plan.config import CHOICES, Config, parse_setting, parse_value
from semidense.pipeline.plan.errors import UsageError, nearest
from semidense.pipeline.plan.steps import products
from semidense.stages.catalog import CATALOG
from semidense.stages.stage import NoParams, Stage


def test_defaults_stand_when_nothing_is_set() -> None:
    assert Config.load() == Config.load(settings=["semidense.R=0.9"])
    assert Config.load().semidense.R == 0.9


@pytest.mark.parametrize("stage", CATALOG, ids=lambda stage: stage.product)
def test_every_product_has_the_section_its_stage_declares(stage: Stage) -> None:
    assert type(Config.load().section(stage.section or stage.product)) is stage.params


def test_a_product_without_settings_has_an_empty_section() -> None:
    assert isinstance(Config.load().section("images"), NoParams)


@pytest.mark.parametrize("section", type(Config.load()).model_fields)
def test_every_field_says_what_it_is(section: str) -> None:
    assert section in (*products(), "training", *CHOICES)
    params: BaseModel = getattr(Config.load(), section)
    assert all(field.description for field in type(params).model_fields.values())


def test_settings_win_over_the_file_and_the_file_over_the_defaults(tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    file.write_text('[semidense]\nR = 0.5\n[channels]\nrank_window = 15\nuse = ["gray"]\n')
    config = Config.load(file, ["semidense.R=0.25"])
    assert (config.semidense.R, config.channels.rank_window, config.channels.use) == (0.25, 15, ("gray",))
    assert config.channels.companion_window == 61


def test_the_last_of_two_settings_wins() -> None:
    assert Config.load(settings=["semidense.R=0.1", "semidense.R=0.2"]).semidense.R == 0.2


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        pytest.param("channels.use=gray,rank", ("gray", "rank"), id="commas make a list"),
        pytest.param("channels.use=rank,gray", ("gray", "rank"), id="channels are put in order"),
        pytest.param('channels.use=["rank"]', ("rank",), id="JSON list"),
        pytest.param("channels.gray=raw", "raw", id="a word without quotes"),
        pytest.param("disparity.subpixel=true", True, id="JSON bool"),
        pytest.param("costvolume.d_min=-3", -3, id="negative number"),
        pytest.param("costvolume.d_min=null", None, id="null is the default again"),
        pytest.param("training.dataset=middlebury:/a=b", "middlebury:/a=b", id="only the first = splits"),
        pytest.param('training.dataset="eth3d:/a,b"', "eth3d:/a,b", id="quotes keep a comma"),
        pytest.param(" semidense.R = 0.5 ", 0.5, id="spaces around"),
    ],
)
def test_values_are_read_as_they_are_meant(setting: str, value: object) -> None:
    section, field, _ = parse_setting(setting)
    assert getattr(getattr(Config.load(settings=[setting]), section), field) == value


def test_a_value_that_is_neither_json_nor_a_list_is_its_text() -> None:
    assert [parse_value(text) for text in ("1e-3", "a", "a,b", "", "'a'")] == [0.001, "a", ["a", "b"], "", "'a'"]


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        pytest.param("semidens.R=0.5", ["no section 'semidens'", "did you mean semidense?"], id="unknown section"),
        pytest.param("channels.rank_windw=3", ["did you mean channels.rank_window?"], id="unknown field"),
        pytest.param("semidense.r=0.5", ["did you mean semidense.R?"], id="wrong case"),
        pytest.param("channels.qqqq=1", ["there are channels.rank_window", "channels.use"], id="nothing near: all"),
        pytest.param("images.x=1", ["no section 'images'"], id="a product that has no settings"),
        pytest.param("semidense.R=1.5", ["semidense.R", "1.5", "less than or equal to 1"], id="above the range"),
        pytest.param("semidense.R=-0.1", ["semidense.R", "greater than or equal to 0"], id="below the range"),
        pytest.param("semidense.R=NaN", ["semidense.R"], id="not a number at all"),
        pytest.param("semidense.R=much", ["semidense.R", "'much'", "valid number"], id="wrong type"),
        pytest.param("semidense.R=", ["semidense.R", "''"], id="empty value"),
        pytest.param("channels.rank_window=4", ["channels.rank_window", "4", "odd"], id="even window"),
        pytest.param("channels.rank_window=3.5", ["channels.rank_window", "3.5"], id="half a pixel"),
        pytest.param("channels.use=gray,blue", ["channels.use.1", "'blue'"], id="one of a list"),
        pytest.param("channels.use=[]", ["channels.use"], id="no channel"),
        pytest.param("matching_net.batch=3", ["matching_net.batch", "multiple of 2"], id="not a multiple"),
        pytest.param("costvolume.precision=float64", ["costvolume.precision", "bfloat16"], id="not a choice"),
        pytest.param("semidense=1", ["'semidense=1'", "section.field=value"], id="no field"),
        pytest.param("semidense.R", ["section.field=value"], id="no value"),
        pytest.param(".R=1", ["section.field=value"], id="no section"),
        pytest.param("", ["section.field=value"], id="nothing"),
    ],
)
def test_a_wrong_setting_is_refused_in_one_line(setting: str, words: list[str]) -> None:
    with pytest.raises(UsageError) as caught:
        Config.load(settings=[setting])
    message = str(caught.value)
    assert "\n" not in message
    assert [word for word in words if word not in message] == []


def test_both_ends_of_the_range_must_be_in_order() -> None:
    with pytest.raises(UsageError, match="d_max 2 lies below d_min 5"):
        Config.load(settings=["costvolume.d_min=5", "costvolume.d_max=2"])


def test_of_several_faults_the_first_is_told_and_the_others_counted() -> None:
    with pytest.raises(UsageError, match=r"semidense\.R = 2: .*\(1 more\)|matching_net\.steps = 0: .*\(1 more\)"):
        Config.load(settings=["semidense.R=2", "matching_net.steps=0"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        pytest.param(b"[semidense\nR=1", ["c.toml", "line 1"], id="broken TOML says where"),
        pytest.param(b"\xff\xfa", ["c.toml", "not plain text"], id="not a text"),
        pytest.param(b"semidense = 3", ["[semidense] must be a table", "3"], id="a value for a section"),
        pytest.param(b"[semidense]\nQ = 3", ["no setting 'Q'", "semidense.R"], id="unknown field"),
        pytest.param(b"[[semidense]]\nR = 0.5", ["[semidense] must be a table"], id="a list of tables"),
        pytest.param(None, ["c.toml", "No such file"], id="missing"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(text: bytes | None, words: list[str], tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    if text is not None:
        file.write_bytes(text)
    with pytest.raises(UsageError) as caught:
        Config.load(file)
    assert "\n" not in str(caught.value)
    assert [word for word in words if word not in str(caught.value)] == []


def test_a_setting_over_a_file_whose_section_is_no_table_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    file.write_text("semidense = 3")
    with pytest.raises(UsageError, match="must be a table"):
        Config.load(file, ["semidense.R=0.5"])


def test_a_folder_is_no_configuration(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="a folder"):
        Config.load(tmp_path)


def test_nearest_gives_the_name_or_all_names() -> None:
    assert nearest("disparty", ["disparity", "images"]) == "did you mean disparity?"
    assert nearest("zzz", ["a", "b"]) == "there are a, b"
    assert nearest("zzz", []) == "it has no settings"
    assert nearest(None, ["none", "some"]) == "there are none, some", "what is no text is near to no name"
