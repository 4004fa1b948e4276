"""A calibration from the tiny training split, and the wishes that rest on it."""

import json
from collections.abc import Callable, Iterator
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open

from semidense.pipeline.api import Task, run
from semidense.pipeline.files.run_files import export
from semidense.pipeline.files.selection import lineage
from semidense.pipeline.pages.report.gathered import gather
from semidense.pipeline.pages.report.graph import graph
from semidense.pipeline.pairs.match import match, match_all
from semidense.pipeline.pairs.wishes import Wishes
from semidense.pipeline.plan import shipped_weights as shipped
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.results.result import Result
from semidense.stages.evaluation.calibration.declaration import BINS
from semidense.stages.evaluation.calibration.table import EDGES, probability
from semidense.stages.evaluation.filtering import threshold_for_error
from semidense.stages.matching.declaration import Mode
from semidense.stages.stage import StageError
from semidense.stages.weights.tables import read_table, save_table
from tests.tiny import NETS, SETTINGS, SPEC, TEST_ONLY


@pytest.fixture(scope="module")
def calibrated(trained: Result, tmp_path_factory: pytest.TempPathFactory) -> Result:
    """The calibration of the tiny training split, in a copy of the session's cache."""
    import shutil

    cache = shutil.copytree(trained.store.root, tmp_path_factory.mktemp("calibrated") / "cache")
    return run(Task(SPEC, settings=SETTINGS, train=True, cache=cache), "calibration")


def test_each_scene_is_scored_by_networks_that_have_not_seen_it(calibrated: Result) -> None:
    calibration = calibrated.find("calibration").step
    assert calibration.settings["fold_of_scene"] == [0, 1]
    for scored in (*calibration.inputs["confidence"], *calibration.inputs["disparity"]):
        behind = lineage(calibrated.made, scored, over_training=True)
        nets = {step.product: step for step in behind if step.product in NETS}
        assert set(nets) >= {"matching_net"}
        assert all(net.settings["steps"] == 1 for net in nets.values()), "half of those for both scenes"
        own = calibrated.made[scored].step.scene
        learnt = {step.scene for step in behind if step.product == "truth"}
        assert learnt == {"train-0", "train-1"} - {own}


def test_the_channels_of_the_training_run_are_reused(calibrated: Result) -> None:
    made = {each.step.product for each in calibrated.made.values() if not each.reused}
    assert not {"images", "truth", "channels"} & made


def test_every_pixel_of_known_truth_is_counted(calibrated: Result) -> None:
    table = calibrated.open("calibration")
    for row, scene in enumerate(("train-0", "train-1")):
        truth = calibrated.open("truth", scene)["disparity"].values
        assert int((table["right"] + table["wrong"]).values[row].sum()) == np.isfinite(truth).sum()


def test_the_file_holds_the_table_and_how_it_was_made(calibrated: Result, tmp_path: Path) -> None:
    written = export(calibrated, tmp_path)
    names = [path.name for path in written]
    assert "calibration.safetensors" in names
    assert not [name for name in names if "_net" in name], "a fold's network is nobody's weights"
    read = read_table((tmp_path / "calibration.safetensors").read_bytes())
    assert np.array_equal(read["right"], calibrated.open("calibration")["right"].values)
    with safe_open(tmp_path / "calibration.safetensors", "numpy") as file:
        configuration = json.loads(file.metadata()["configuration"])
    assert {configuration[net]["steps"] for net in NETS} == {1}
    assert configuration["calibration"]["folds"] == 2


def table_file(folder: Path, wrong: int, name: str = "calibration", tolerance: float = 1.0) -> None:
    """Ship a table in which pixels of a confidence above 0.5 are wrong once in ten, above 0.8 ``wrong`` in 100."""
    p = probability((EDGES[1:] + EDGES[:-1]) / 2)
    bad = np.where(p < 0.5, 50, np.where(p < 0.8, 10, wrong)).astype(np.int64)
    counts = np.tile(bad, (3, 1))
    arrays = {
        "right": 100 - counts,
        "wrong": counts,
        "score": np.array([0.2, 0.1, 0.3]),
        "log_odds": 0.5 * EDGES,
        "tolerance": np.full(3, tolerance),
    }
    (folder / f"{name}.safetensors").write_bytes(save_table(arrays, {}))
    shipped.weights_digest.cache_clear()


@pytest.fixture
def table(weights: Path) -> Iterator[Path]:
    """Weights with a table beside them."""
    table_file(weights, wrong=1)
    yield weights
    shipped.weights_digest.cache_clear()


def test_a_wanted_error_decides_the_threshold_of_a_run(table: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    task = Task(TEST_ONLY, settings=["semidense.max_error=0.7"], cache=cache)
    result = run(task, "metrics")
    kept, confidence = (result.open(product) for product in ("semidense", "confidence"))
    raw = result.open("disparity")["disparity"].values
    probability = result.open("calibrated_confidence")["confidence"].values
    least = threshold_for_error(0.7, raw, probability)
    assert np.array_equal(np.isfinite(kept["disparity"].values), probability >= np.float32(least))
    assert kept["R"].values.tolist() == [confidence["confidence"].values[probability >= np.float32(least)].min()]
    assert all("R" not in row for row in result.metrics), "R is the map's, not the user's"
    assert "semidense" in graph(gather(task))


def test_by_default_neither_table_nor_calibrated_confidence_is_made(table: Path, tmp_path: Path) -> None:
    result = run(Task(TEST_ONLY, cache=tmp_path / "cache"), "metrics")
    assert not {"calibration", "calibrated_confidence"} & {each.step.product for each in result.made.values()}


def test_calibrated_and_plain_keep_the_same_pixels_for_a_wanted_error(table: Path, tmp_path: Path) -> None:
    task = Task(TEST_ONLY, cache=tmp_path / "cache")
    plain, calibrated = (match_all(task, Wishes(max_error=0.7, calibrated=each))[0] for each in (False, True))
    assert np.array_equal(plain.disparity, calibrated.disparity, equal_nan=True)
    assert not np.array_equal(plain.confidence, calibrated.confidence)
    assert calibrated.made("calibrated_confidence").step.scene == calibrated.scene.name


def test_a_wanted_error_may_be_of_larger_errors(table: Path, tmp_path: Path) -> None:
    table_file(table, 0, "calibration.3px", 3.0)
    task = Task(TEST_ONLY, cache=tmp_path / "cache")
    usual, wider = (match_all(task, Wishes(max_error=0.7, within=px))[0] for px in (None, 3))
    assert usual.basis and wider.basis
    assert (usual.basis.tolerances, wider.basis.tolerances) == ((1.0,), (3.0,))
    assert "wrong by more than 3 px" in wider.basis.words


def test_the_basis_is_in_the_summary(table: Path, tmp_path: Path) -> None:
    from semidense.pipeline.pairs.match_files import save

    found = match_all(Task(TEST_ONLY, cache=tmp_path / "cache"), Wishes(max_error=0.7))[0]
    about = save(found, tmp_path / "out", ["npy"])
    assert 0 < found.density < 1
    assert 0 < about["expected_error_percent"] <= 70
    assert about["wishes"]["max_error"] == 0.7
    assert about["R_basis"].startswith(
        f"R = {found.R:.3f}; in 3 training scenes that the networks had not seen the same"
    )


def test_an_error_that_no_pixel_is_sure_of_keeps_nothing_and_says_so(table: Path, tmp_path: Path) -> None:
    from semidense.pipeline.pairs.match_files import save

    found = match_all(Task(TEST_ONLY, cache=tmp_path / "cache"), Wishes(max_error=1e-6))[0]
    about = save(found, tmp_path / "out", ["npy"])
    assert (found.density, about["expected_error_percent"]) == (0, None)
    assert about["R_basis"].startswith("no pixel is sure enough for that error; in 3 training scenes")


@pytest.mark.parametrize(
    ("name", "command"), [("calibration", "DATA=DIR`"), ("calibration.guided", "DATA=DIR MODE=guided`")]
)
def test_without_a_table_it_says_what_to_do(
    name: str, command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semidense.pipeline.plan.shipped_weights.resources.files", lambda _: tmp_path)
    shipped.weights_digest.cache_clear()
    with pytest.raises(StageError, match=f"no calibration of such volumes comes .*`make calibration {command}"):
        shipped.weights_digest(name)


@pytest.mark.parametrize(
    ("wishes", "message"),
    [
        pytest.param({"R": 0.5, "max_error": 0.1}, "R and max_error both say", id="R and an error"),
        pytest.param({"density": 0.5, "max_error": 0.1}, "density and max_error both say", id="density and an error"),
        pytest.param({"within": 3.0}, "give max-error or calibrated too", id="a tolerance of nothing"),
        pytest.param({"max_error": 0.0}, "semidense.max_error", id="no error at all"),
        pytest.param({"max_error": 1.0}, "semidense.max_error", id="any error"),
    ],
)
def test_wishes_that_cannot_be_are_refused(table: Path, tmp_path: Path, wishes: dict[str, float], message: str) -> None:
    view = np.zeros((64, 80), np.uint8)
    with pytest.raises(UsageError, match=message):
        match(view, view, d_min=0, d_max=4, cache=tmp_path / "cache", **wishes)


def test_the_settings_refuse_two_wishes() -> None:
    with pytest.raises(UsageError, match="give one of them"):
        run(Task(TEST_ONLY, settings=["semidense.max_error=0.1", "semidense.density=0.5"]), "semidense")


def test_the_command_says_what_the_threshold_rests_on(
    table: Path, tmp_path: Path, make_pair: Callable[[Path], Path], invoke: Callable[..., object]
) -> None:
    pair = make_pair(tmp_path / "pair")
    files = pair / "im0.png", pair / "im1.png"
    arguments = ["match", *files, "--preset", "paper", "--max-disp", 4, "--cache", tmp_path / "cache"]
    ran = invoke(*arguments, "--max-error", "5%", "-o", tmp_path / "out", "--format", "npy")
    assert ran.code == 0, ran.err
    assert "training scenes that the networks had not seen" in ran.out
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["R_from"] == "for the error asked for"
    unclear = invoke(*arguments, "--max-error", "small")
    assert (unclear.code, "such as 2% or 0.02" in unclear.err) == (2, True)


def test_the_bins_are_wide_enough_for_both_ends() -> None:
    assert probability(EDGES[[0, -1]]).round(5).tolist() == [5e-05, 0.99995]
    assert EDGES.size == BINS + 1


def test_the_general_weights_were_made_by_the_recipe_of_the_preset() -> None:
    config, open_ends = Config.load(preset="robust").to_dict(), {"tiles": None, "precision": None}
    for product in ("descriptor_net", "evaluation_net", "evidence_net", "calibration"):
        file = shipped.weights_file(shipped.weights_of(Config.load(preset="robust"), product).name)
        with safe_open(str(file), "numpy") as opened:
            made = json.loads(opened.metadata()["configuration"])
        assert set(made) >= {product, "matching_samples"}
        for section in made.keys() & {"matching_samples", "evaluation_samples", "evidence_samples"}:
            assert made[section] | open_ends == config[section] | open_ends
        if product != "calibration":
            assert made[product] | open_ends == config[product] | open_ends


@pytest.mark.parametrize("mode", ["exact", "guided"])
def test_the_shipped_table_was_made_for_the_shipped_networks(mode: Mode) -> None:
    about = {}
    for product in ("evaluation_net", "calibration"):
        file = resources.files("semidense.stages") / "weights" / f"{shipped.weights_name(product, mode)}.safetensors"
        if not file.is_file():
            pytest.skip(f"{file.name} is not there: make evaluation calibration DATA=DIR MODE={mode}")
        with safe_open(str(file), "numpy") as opened:
            about[product] = {key: json.loads(text) for key, text in opened.metadata().items() if key != "product"}
    net, table = about["evaluation_net"], about["calibration"]
    assert {each["configuration"]["costvolume"].get("mode", "exact") for each in (net, table)} == {mode}
    for section in ("evaluation_samples", "evaluation_net"):
        settings = [{**each["configuration"][section], "steps": None, "precision": None} for each in (net, table)]
        assert settings[0] == settings[1]
    counts = read_table(shipped.weights_file(shipped.weights_name("calibration", mode)).read_bytes())["right"]
    assert len(counts) == len(net["training_data"]["disparity"]), "a row a scene"
