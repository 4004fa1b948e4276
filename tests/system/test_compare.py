"""The comparison on the smallest scenes: every row there, every reason given, nothing computed twice."""

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from semidense.datasets import open_dataset
from semidense.pipeline import compare
from semidense.pipeline.api import Task
from semidense.pipeline.comparison import prepared
from semidense.pipeline.comparison.ablation import ABLATION
from semidense.pipeline.comparison.experiments import Comparison
from semidense.pipeline.comparison.files import COLUMNS, write_comparison
from semidense.pipeline.comparison.methods import LOWERED, MATCHERS, MEASURES
from semidense.pipeline.comparison.paper_figures import NAMED, QUOTED
from semidense.pipeline.comparison.prepared import BESIDE, EXPERIMENTS
from semidense.pipeline.comparison.protocols import protocol_requests
from semidense.pipeline.comparison.tables import print_comparison
from semidense.pipeline.pages.report import report
from semidense.pipeline.plan.environment import missing_packages
from semidense.pipeline.plan.errors import UsageError
from semidense.stages.catalog import STAGES
from tests.tiny import SETTINGS, SPEC, TEST_ONLY

QUICK = (*SETTINGS, "o1_forest.samples=500", "ccnn_net.steps=2", "ccnn_net.batch=2", "ccnn_net.crop=16")
Invoke = Callable[..., Any]


@pytest.fixture(scope="module")
def task(tmp_path_factory: pytest.TempPathFactory) -> Task:
    return Task(SPEC, settings=QUICK, cache=tmp_path_factory.mktemp("compared") / "cache")


@pytest.fixture(scope="module")
def found(task: Task) -> Comparison:
    return compare(task, train_on=SPEC)


def installed(product: str) -> bool:
    stage = STAGES[product]
    return not any(missing_packages(STAGES[name]) for name in (product, *stage.inputs) if name in STAGES)


def methods(found: Comparison, experiment: str) -> set[str]:
    return {row["method"] for row in found.rows if row["experiment"] == experiment}


def test_every_method_that_can_run_has_its_rows(found: Comparison) -> None:
    matchers = {method for method, product in MATCHERS.items() if installed(product)}
    lowered = {LOWERED} if "MC-CNN accurate" in matchers else set()
    ours = {f"dual-cnn, {name}" for name in BESIDE}
    assert methods(found, "raw") == matchers | lowered | {"dual-cnn, shipped weights"} | ours | set(ABLATION)
    assert methods(found, "density") == matchers | {"dual-cnn"} | ours
    measures = {method: product for method, (product, _) in MEASURES.items() if installed(product)}
    own = {f"{each}, {name}" for each, product in measures.items() if product == "confidence" for name in BESIDE}
    assert methods(found, "auc") == {*measures} | own


def test_the_preset_robust_stands_beside_the_default_one(found: Comparison, task: Task) -> None:
    """Its row is what a comparison of the preset itself finds, which has no such rows."""
    own = compare(replace(task, preset="robust", scenes=["test-0"]), ("raw", "density"))
    assert not any("preset" in row["method"] for row in own.rows)
    for experiment, method in (("raw", "dual-cnn, shipped weights"), ("density", "dual-cnn")):
        rows, beside = (
            [
                {name: value for name, value in row.items() if name != "method"}
                for row in each.rows
                if (row["experiment"], row["method"]) == (experiment, wanted)
            ]
            for each, wanted in ((own, method), (found, "dual-cnn, preset robust"))
        )
        assert rows and rows == beside


def test_training_scenes_are_not_compared_on(found: Comparison) -> None:
    assert found.scenes == ["test-0"]
    assert any("train-0 and train-1 are training scenes" in note for note in found.notes)


def test_figures_hold_together(found: Comparison) -> None:
    at = [row for row in found.rows if row["mask"] == "nonocc" and row["threshold_px"] == 1]
    for row in at:
        if row["experiment"] == "auc":
            assert row["auc_optimal"] - 1e-6 <= row["auc"] <= 1
        for name in ("raw_bad", "bad", "bad_dual_cnn", "invalid"):
            assert 0 <= row.get(name, 0) <= 100
    raw = next(row for row in at if row["method"] == "dual-cnn, shipped weights")
    curve = next(row for row in at if row["experiment"] == "curve" and row["R"] == 0)
    assert curve["bad"] == pytest.approx(raw["raw_bad"]), "R = 0 keeps all of a map without holes"
    ours = next(row for row in at if row["experiment"] == "density" and row["method"] == "dual-cnn")
    point = next(row for row in at if row["experiment"] == "curve" and row["R"] == ours["R"])
    assert (point["invalid"], point.get("bad")) == (ours["invalid"], ours.get("bad"))


def test_the_mean_of_one_scene_is_the_scene(found: Comparison) -> None:
    assert [row["method"] for row in found.means] == [row["method"] for row in found.rows]
    assert all(mean["scene"] == "mean of 1" for mean in found.means)
    assert [row.get("auc") for row in found.means] == [row.get("auc") for row in found.rows]


def test_a_second_comparison_computes_nothing_and_says_the_same(found: Comparison, task: Task) -> None:
    again = compare(task, train_on=SPEC)
    assert all(made.reused for made in again.result.made.values())
    assert again.rows == found.rows


def test_the_report_shows_what_is_cached_and_says_the_same(found: Comparison, task: Task, tmp_path: Path) -> None:
    page = report(task, tmp_path / "report.html").read_text()
    for row in (row for row in found.rows if row["mask"] == "nonocc" and row["threshold_px"] == 1):
        if "preset" in row["method"]:  # other settings: a report of the task shows its own
            continue
        if row["experiment"] == "auc":
            assert row["method"] in page and f'<td class="number">{row["auc"]:.4f}</td>' in page
        if row["experiment"] == "density" and "R" not in row:
            assert f'<td class="number">{row["invalid"]:.2f}</td>' in page, "the table"
            assert ("bad" in row) == (f">{row['method']} (other matcher)</text>" in page), "the curve's legend"


def test_the_report_makes_nothing_and_leaves_out_other_settings(task: Task, tmp_path: Path) -> None:
    other = replace(task, settings=[*task.settings, "sgm.window=7", "o1_forest.samples=400"])
    before = {path for path in Path(str(task.cache)).rglob("*") if path.parent.name != "leases"}
    page = report(other, tmp_path / "report.html").read_text()
    assert (">CCNN<" in page) and not any(name in page for name in (">SGM (OpenCV SGBM)<", ">O1<"))
    assert {path for path in Path(str(task.cache)).rglob("*") if path.parent.name != "leases"} <= before


def test_the_papers_protocols_stand_beside_ours(found: Comparison, task: Task) -> None:
    """Two scenes: each is trained on and tested, and each is tested by networks that learnt from the other."""
    two = replace(task, dataset=SPEC.replace("test=1", "test=2"))
    made = compare(two, train_on=SPEC, protocols=("same", "folds"))
    ours = [row for row in made.rows if "dual-cnn" in row["method"] or "Net" in row["method"]]
    for experiment, method in (("raw", "dual-cnn"), ("density", "dual-cnn"), ("auc", "evaluation-Net")):
        for name in ("trained on the same pairs", "2-fold"):
            scenes = {r["scene"] for r in ours if (r["experiment"], r["method"]) == (experiment, f"{method}, {name}")}
            assert scenes == {"test-0", "test-1"}
    assert {row["method"] for row in made.rows if row["experiment"] == "curve"} == {"dual-cnn"}


def test_the_folds_keep_a_place_together(task: Task) -> None:
    """Another exposure of a scene that is tested is not learnt from."""
    scenes = open_dataset(SPEC.replace("test=1", "test=4")).scenes
    names = ["Piano", "PianoL", "Teddy", "Shelves"]
    tested = tuple(replace(scene, name=name) for scene, name in zip(scenes[-4:], names, strict=True))
    dataset = replace(open_dataset(SPEC), scenes=tested)
    for request in protocol_requests("folds", task, dataset, scenes[:1]):
        learnt, seen = ({scene.name for scene in each} for each in (request.training, request.dataset.scenes))
        assert ("Piano" in seen) == ("PianoL" in seen)
        assert learnt == {*names, scenes[0].name} - seen


def test_what_needs_training_says_so_without_a_training_set(found: Comparison, task: Task) -> None:
    plain = compare(replace(task, dataset=TEST_ONLY), ("raw", "auc"))
    reasons = {each["method"]: each["why"] for each in plain.unavailable}
    assert all("--train-on" in reasons[method] for method in (*ABLATION, "CCNN"))
    assert not methods(plain, "density")


def test_the_plan_of_a_comparison_holds_every_product_of_all_its_runs_once(found: Comparison, task: Task) -> None:
    plan = prepared.prepare(task, train_on=SPEC).plan()
    assert plan.todo() == ()
    ids = [each.step.id for each in plan.steps]
    assert len(set(ids)) == len(ids)
    assert {*found.result.made} < {*ids}, "the runs of other presets and networks are in it too"


def test_without_a_package_its_rows_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    from semidense.pipeline.plan import environment

    monkeypatch.setattr(environment, "_installed", lambda _: False)
    products, unavailable = prepared._available(EXPERIMENTS, True, ())
    reasons = {each["method"]: each["why"] for each in unavailable}
    assert products == ("sncc", "census", "cost_confidence", "ccnn")
    assert "opencv-python-headless" in reasons["SGM (OpenCV SGBM)"] and "mccnn" in reasons["MC-CNN fast"]
    assert "scikit-learn" in reasons["O1"]
    assert set(NAMED) <= set(reasons)


def test_what_is_left_out_is_not_made_and_says_so(task: Task) -> None:
    left_out = ("census", "cost_confidence")
    made = compare(replace(task, dataset=TEST_ONLY), ("density", "auc"), without=left_out)
    reasons = {each["method"]: each["why"] for each in made.unavailable}
    gone = {"census", "APKR", "PKRN", "left-right difference", "cost"}
    assert {method for method, why in reasons.items() if why == "left out on request"} == gone
    assert "SNCC" in methods(made, "density") and not gone & {row["method"] for row in made.rows}
    assert not {*left_out} & {each.step.product for each in made.result.made.values()}


def test_without_the_ablation_no_matching_net_is_trained(found: Comparison, task: Task) -> None:
    made = compare(task, ("raw",), SPEC, without=("ablation",))
    reasons = {each["method"]: each["why"] for each in made.unavailable}
    assert {method for method, why in reasons.items() if why == "left out on request"} == set(ABLATION)
    assert methods(made, "raw") == methods(found, "raw") - set(ABLATION)


def test_files_hold_all_rows_and_what_is_quoted(found: Comparison, tmp_path: Path) -> None:
    files = write_comparison(found, tmp_path / "new")
    names = {"comparison.csv", "comparison.json", "raw.png", "auc.png", "density.png", "texture.png"}
    assert {file.name for file in files} == names
    written = list(csv.DictReader(files[0].read_text().splitlines()))
    assert tuple(written[0]) == COLUMNS
    assert len(written) == len(found.rows) + len(found.means) + len(QUOTED)
    assert sum(row["quoted"] == "True" for row in written) == len(QUOTED)
    assert json.loads(files[1].read_text())["rows"] == found.rows
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in files[2:])


def test_the_tables_name_every_method(found: Comparison, capsys: pytest.CaptureFixture[str]) -> None:
    print_comparison(found, ["exact"])
    out = capsys.readouterr().out
    for method in (*ABLATION, *methods(found, "auc"), "optimal", "dual-cnn (paper)", "R-NCC", "TMAP"):
        assert method in out, method


def test_tables_are_of_the_threshold_that_was_wished_for(found: Comparison, capsys: pytest.CaptureFixture[str]) -> None:
    raw = {
        row["threshold_px"]: row["raw_bad"]
        for row in found.means
        if (row["experiment"], row["method"], row["mask"]) == ("raw", "dual-cnn, shipped weights", "nonocc")
    }
    assert raw[0.5] != raw[4.0]
    for threshold in (0.5, 4.0):
        print_comparison(found, ["exact"], threshold)
        out = capsys.readouterr().out
        assert f"off by more than {threshold:g} px" in out and f"{raw[threshold]:.2f}" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        pytest.param(["--experiment", "row"], "did you mean raw", id="an experiment that does not exist"),
        pytest.param(["--train-on", TEST_ONLY], "no training scene", id="nothing to train on"),
        pytest.param(["--protocol", "fold"], "did you mean folds", id="a protocol that does not exist"),
        pytest.param(["--protocol", "folds"], "2 folds take 2 scenes", id="too few scenes for folds"),
        pytest.param(["--without", "mc-cnn"], "did you mean mc_cnn?", id="a matcher that does not exist"),
        pytest.param(["--threshold", "3"], "--threshold 3: figures are worked out for 0.5, 1, 2, 4 px", id="threshold"),
        pytest.param(["--set", "sgm.windo=3"], "did you mean sgm.window", id="a setting that does not exist"),
    ],
)
def test_a_mistake_is_one_line_and_writes_nothing(
    invoke: Invoke, tmp_path: Path, arguments: list[str], message: str
) -> None:
    ran = invoke("compare", TEST_ONLY, *arguments, "-o", str(tmp_path / "out"), "--cache", str(tmp_path / "cache"))
    assert ran.code == 2 and message in ran.err and len(ran.err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_single_baseline_without_its_package_is_refused(monkeypatch: pytest.MonkeyPatch, task: Task) -> None:
    from semidense.pipeline.api import status
    from semidense.pipeline.plan import environment

    monkeypatch.setattr(environment, "_installed", lambda _: False)
    with pytest.raises(UsageError, match=r"sgm needs opencv-python-headless: pip install"):
        status(task, "sgm")


def test_training_is_asked_for_in_one_way_alone(task: Task) -> None:
    with pytest.raises(UsageError, match="train_on"):
        compare(replace(task, train=True))
