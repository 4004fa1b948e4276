"""Maps of other matchers through the pipeline: the command ``score``, ``sweep``, ``compare --map``."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from semidense import pipeline
from semidense.datasets import open_dataset, read_pfm, write_pfm
from semidense.pipeline.api import Task
from semidense.pipeline.comparison.experiments import compare
from semidense.pipeline.plan.errors import UsageError
from semidense.stages.evaluation.filtering import keep_confident
from semidense.stages.stage import StageError
from tests.tiny import TEST_ONLY

Invoke = Callable[..., Any]
SHAPE = (40, 64)
FAST = ("costvolume.mode=fast",)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A pair of noise, 3 px apart, and a map of it that is wrong in its right half."""
    place = tmp_path_factory.mktemp("scored")
    wide = np.random.default_rng(0).integers(0, 256, (SHAPE[0], SHAPE[1] + 3), np.uint8)
    for name, view in (("left.png", wide[:, :-3]), ("right.png", wide[:, 3:])):
        Image.fromarray(view).save(place / name)
    disparity = np.full(SHAPE, 3, np.float32)
    disparity[:, 32:] = np.random.default_rng(1).integers(0, 12, (SHAPE[0], 32))
    disparity[:4] = np.nan
    write_pfm(place / "map.pfm", disparity)
    return place


def test_one_command_from_a_map_to_a_folder(invoke: Invoke, folder: Path, tmp_path: Path) -> None:
    arguments = ["score", folder / "left.png", folder / "map.pfm", folder / "right.png", "--cache", folder / "cache"]
    ran = invoke(*arguments, "--R", "0.5", "-o", tmp_path / "out", "--format", "pfm")
    assert ran.code == 0, ran.err
    assert "with 1 to a pixel: 90.0 % of the pixels have a disparity, 0 to 11 px" in ran.out
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"disparity.pfm", "disparity_raw.pfm", "confidence.pfm", "summary.json"} <= names
    given, kept, sure = (
        read_pfm(tmp_path / "out" / f"{name}.pfm") for name in ("disparity_raw", "disparity", "confidence")
    )
    np.testing.assert_array_equal(given, read_pfm(folder / "map.pfm"))
    np.testing.assert_array_equal(kept, keep_confident(given, sure, 0.5))
    again = invoke(*arguments, "--density", "40%", "-o", tmp_path / "out", "--json")
    (about,) = json.loads(again.out)["pairs"]
    assert {"images", "disparity", "confidence"} <= set(about["reused"]), "another filter makes no other confidence"
    assert about["map_reading"] == {"scale": 1.0, "none": None}


def test_a_plan_a_file_of_settings_and_no_progress(invoke: Invoke, folder: Path, tmp_path: Path) -> None:
    (tmp_path / "half.toml").write_text("[semidense]\nR = 0.5\n")
    arguments = [
        "score",
        folder / "left.png",
        folder / "map.pfm",
        "--config",
        tmp_path / "half.toml",
        "-o",
        tmp_path / "o",
    ]
    planned = invoke(*arguments, "--dry-run", "--json", "--cache", tmp_path / "cache")
    steps = json.loads(planned.out)["steps"]
    assert {"foreign_net", "semidense"} <= {step["product"] for step in steps}
    assert not (tmp_path / "o").exists() and {step["state"] for step in steps} == {"missing"}
    ran = invoke(*arguments, "-q", "--format", "pfm", "--cache", folder / "cache")
    assert ran.code == 0 and "at R = 0.5" in ran.out and not ran.err


def test_the_right_view_tells_right_from_wrong(folder: Path) -> None:
    """In noise the map itself says little; our costs of its disparities say it all."""
    found = pipeline.score(folder / "left.png", folder / "map.pfm", folder / "right.png", cache=folder / "cache")
    right, wrong = found.confidence[8:36, 8:24], found.confidence[8:36, 40:60][found.raw[8:36, 40:60] != 3]
    assert np.median(right) > np.quantile(wrong, 0.9)
    assert (found.confidence[:4] == 0).all(), "no disparity, no confidence"


def test_arrays_are_scored_as_files_are(folder: Path) -> None:
    files = folder / "left.png", folder / "map.pfm", folder / "right.png"
    left, right = (np.asarray(Image.open(file)) for file in (files[0], files[2]))
    for given, arrays in ((files, (left, read_pfm(files[1]), right)), (files[:2], (left, read_pfm(files[1])))):
        one, other = (pipeline.score(*each, cache=folder / "cache") for each in (given, arrays))
        np.testing.assert_array_equal(one.confidence, other.confidence)
        assert one.disparities == other.disparities


def test_a_wanted_error_needs_no_calibration(folder: Path) -> None:
    found = pipeline.score(folder / "left.png", folder / "map.pfm", cache=folder / "cache", max_error=0.3)
    assert found.basis is None and (found.expected_error is None or found.expected_error <= 0.3)


@pytest.mark.parametrize("wish", ["right_view", "subpixel", "calibrated", "sharpness"])
def test_what_score_does_not_offer_is_refused(folder: Path, wish: str) -> None:
    with pytest.raises(UsageError, match=f"score takes no {wish}; it takes R, density, max_error"):
        pipeline.score(folder / "left.png", folder / "map.pfm", cache=folder / "cache", **{wish: True})


def test_the_left_view_given_twice_is_warned_of(invoke: Invoke, folder: Path, tmp_path: Path) -> None:
    left, place = folder / "left.png", ["-o", tmp_path / "out", "--cache", folder / "cache"]
    assert "the two views are the same picture" in invoke("score", left, folder / "map.pfm", left, *place).err


def test_the_map_in_the_place_of_the_right_view_is_told(invoke: Invoke, folder: Path) -> None:
    ran = invoke("score", folder / "left.png", folder / "right.png", folder / "map.pfm")
    assert (ran.code, ran.err.count("\n")) == (2, 1) and "the map comes second" in ran.err


def test_without_a_right_view_what_needs_it_is_refused(folder: Path) -> None:
    task = Task(f"pair:{folder}/left.png,disparity={folder}/map.pfm", cache=folder / "cache")
    with pytest.raises(StageError, match="channels needs the right view, which was not given"):
        pipeline.run(task, "channels")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        pytest.param(["--scale", "0"], "stored value of 1 px", id="a scale that is none"),
        pytest.param(["--scale", "0.01"], "px in an image of 64 px", id="a scale that cannot be"),
        pytest.param(["--R", "0.5", "--density", "50%"], "give one of them", id="two wishes"),
    ],
)
def test_a_mistake_is_one_line(invoke: Invoke, folder: Path, tmp_path: Path, options: list[str], message: str) -> None:
    ran = invoke("score", folder / "left.png", folder / "map.pfm", *options, "-o", tmp_path / "out")
    assert ran.code == 2 and message in ran.err and len(ran.err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_misread_map_is_warned_of(invoke: Invoke, folder: Path, tmp_path: Path) -> None:
    files = folder / "left.png", folder / "map.pfm", folder / "right.png"
    ran = invoke("score", *files, "--scale", "0.5", "-o", tmp_path / "out", "--cache", folder / "cache")
    assert ran.code == 0 and "does not fit the right view" in ran.err and "half as large" in ran.err


@pytest.fixture(scope="module")
def maps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Maps of the smallest test scene: the truth, wrong by 5 px in its lower half."""
    place = tmp_path_factory.mktemp("maps")
    (scene,) = open_dataset(TEST_ONLY).scenes
    truth = scene.load().truth
    assert truth is not None
    wrong = truth.disparity + np.where(np.arange(64)[:, None] < 32, 0, 5).astype(np.float32)
    write_pfm(place / "test-0.pfm", wrong)
    return place


def test_sweep_and_metrics_work_on_a_map(maps: Path) -> None:
    task = Task(f"map:{maps}/*.pfm@{TEST_ONLY}", preset="foreign", cache=maps / "cache")
    rows = pipeline.sweep(task, "0.1,0.9").metrics
    dense = {row["raw_bad"] for row in rows if row["mask"] == "all" and row["threshold_px"] == 1}
    assert len(dense) == 1 and 40 < dense.pop() < 60, "the lower half is wrong"
    assert {row["R"] for row in rows} == {0.1, 0.9}


def test_a_folder_of_maps_stands_beside_ours(maps: Path) -> None:
    left_out = ("sgm", "sncc", "census", "mc_cnn", "mc_cnn_accurate", "cost_confidence", "o1", "ccnn", "ablation")
    task = Task(TEST_ONLY, settings=FAST, cache=maps / "cache")
    found = compare(task, without=left_out, maps={"wrong below": f"{maps}/*.pfm"})
    methods = {experiment: set() for experiment in ("raw", "density", "auc")}
    for row in found.rows:
        methods.setdefault(row["experiment"], set()).add(row["method"])
    assert "wrong below" in methods["raw"]
    assert {"wrong below", "wrong below, filtered by our score"} <= methods["density"]
    assert "our score of wrong below" in methods["auc"]
    (raw,) = (
        row["raw_bad"]
        for row in found.rows
        if (row["experiment"], row["method"], row["mask"], row["threshold_px"]) == ("raw", "wrong below", "all", 1)
    )
    assert 40 < raw < 60
