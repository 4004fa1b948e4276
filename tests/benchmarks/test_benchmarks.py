"""Each benchmark on the smallest input: it runs, prints its table and leaves its JSON. What it measures is no test."""

import json
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import typer

from benchmarks import (
    aggregation,
    agreement,
    cost_volume,
    domains,
    growth,
    held_out,
    low_rank,
    many_scenes,
    memory,
    own_pairs,
    peers,
    recipe,
    timeline,
    training,
    transforms,
    workers,
)
from benchmarks.harness import Ratio, as_command, compare
from semidense.cache import Store
from semidense.datasets import open_dataset, write_pfm
from semidense.pipeline.api import Task, run
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.results.result import Result
from semidense.stages.matching.net import MatchingNet
from semidense.stages.metrics.confidence import auc
from tests.tiny import SETTINGS, SPEC

TINY = "synthetic:train=0,test=1,height=48,width=64,disparities=4"


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def aggregation_on_little() -> None:
    aggregation.main(shrink=8)


def growth_on_little() -> None:
    growth.main(shrink=4, pairs=1)


def many_scenes_on_little() -> None:
    many_scenes.main(scenes=3, variants=2, fresh=1)


def memory_on_little() -> None:
    memory.main(size=["48x64x4"])


def own_pairs_on_little() -> None:
    pytest.importorskip("cv2", reason="needs the extra baselines")
    own_pairs.main(shrink=8, times=1, install=False)


def training_on_little() -> None:
    training.main(batch=1, patches=1, pairs=1)


def workers_on_little() -> None:
    workers.main(rows=48, columns=64, disparities=4, pairs=1)


@pytest.mark.parametrize(
    ("run", "name", "told"),
    [
        pytest.param(aggregation_on_little, "aggregation", "peak of aggregation", id="aggregation"),
        pytest.param(growth_on_little, "growth", "time a cell", id="growth"),
        pytest.param(many_scenes_on_little, "many_scenes", "explain", id="many scenes"),
        pytest.param(memory_on_little, "memory", "peak of a run", id="memory"),
        pytest.param(own_pairs_on_little, "own_pairs", "each further pair", id="own pairs"),
        pytest.param(training_on_little, "training", "times patches", id="training"),
        pytest.param(workers_on_little, "workers", "two workers", id="workers"),
    ],
)
def test_runs(
    run: Callable[[], None], name: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run()
    assert told in capsys.readouterr().out
    found = json.loads((tmp_path / "build" / "bench" / f"{name}.json").read_text())
    least = -np.inf if name == "own_pairs" else 0  # of pairs this small, a further one may cost less than chance
    assert found["name"] == name and all(least < pair < np.inf for ratio in found["ratios"] for pair in ratio["pairs"])


def test_the_matchers_are_told_with_their_errors_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("cv2", reason="needs the extra baselines")
    cost_volume.main(rows=11, pairs=1, install=False, dataset=TINY, picture=tmp_path / "p.png")
    assert "SGBM" in capsys.readouterr().out
    found = json.loads((tmp_path / "build" / "bench" / "matchers.json").read_text())["matchers"]
    assert all(0 <= each["raw_bad"] <= 100 and each["seconds"] > 0 for each in found.values())
    assert (tmp_path / "p.png").stat().st_size > 1000


def test_worlds_stand_beside_each_other(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("cv2", reason="needs the extra baselines")
    (scene,) = open_dataset(TINY).scenes
    truth = scene.load().truth
    assert truth is not None
    for ending in ("pfm", "checked.pfm"):
        write_pfm(tmp_path / f"{scene.name}.{ending}", truth.disparity + np.float32(1.5))
    domains.main([TINY], setting=["semidense.R=0.9"], pandora=tmp_path, cache=tmp_path / "cache")
    printed = capsys.readouterr().out
    assert "a wanted error" in printed and "at Pandora's density >1" in printed
    found = json.loads((tmp_path / "build" / "bench" / "domains.json").read_text())["datasets"][TINY]
    assert found["scenes"] == 1 and 0 <= found["dense >1"] <= 100
    assert found["dense >1"] >= found["dense >2"] >= found["dense >3"]
    assert [found[f"Pandora >{limit}"] for limit in (1, 2)] == [100, 0]


def test_a_map_that_is_not_there_is_told_before_anything_is_matched(tmp_path: Path) -> None:
    (scene,) = open_dataset(TINY).scenes
    with pytest.raises(typer.BadParameter, match=rf"{scene.name}\.pfm is not there"):
        domains.main([TINY], pandora=tmp_path, cache=tmp_path / "cache")
    assert not (tmp_path / "cache").exists()


def test_shares_of_wrong_pixels_by_hand() -> None:
    """Five pixels, of which the last does not count; SGBM keeps two of the four, one of them wrong."""
    row = np.float32([[10, 10, 10, 10, 10]])
    score = np.float32([[0.95, 0.92, 0.5, 0.1, 1.0]])
    maps = domains._Maps(
        truth=row, mask=np.array([[True, True, True, True, False]]), own=row + np.float32([[0, 1.5, 0, 9, 9]]),
        others={
            "SGBM": domains._Other(row + np.float32([[5, 0, 5, 0, 0]]), row + np.float32([[np.nan, 0, 5, np.nan, 0]]))
        },
        score=score, chance={1.0: score},
    )  # fmt: skip
    shares = domains._shares(maps, score >= np.float32(0.9), domains.Ranking.of(score[maps.mask]), 1.0)
    assert [*shares.values()] == [50, 50, 50, 50, 50]
    shares = domains._shares(maps, score >= np.float32(0.9), domains.Ranking.of(score[maps.mask]), 2.0)
    assert [*shares.values()] == [25, 50, 0, 50, 0]
    # A mean doubt of (0 + 0.05 + 0.08) / 3 is within 5 %: three pixels are kept, two of them count.
    assert domains._promised(maps, 0.05) == {"0.05 kept, within 1 px": 50, "0.05 wrong, > 1 px": 50}
    # 0.95 and 0.92 share a bin with one right pixel; 0.5 is right and 0.1 is wrong, each in a bin of its own.
    expected = (abs(0.95 + 0.92 - 1) + 0.5 + 0.1) / 4
    assert domains._calibration_errors([maps, maps], 1.0) == pytest.approx(
        {"ECE > 1 px": expected, "ECE a scene > 1 px": expected, "ECE with vetoed > 1 px": expected}, abs=1e-6
    )
    score[0, 3] = 0  # a veto: the pixel has no probability
    errors = domains._calibration_errors([maps], 1.0)
    assert errors["ECE > 1 px"] == pytest.approx((abs(0.95 + 0.92 - 1) + 0.5) / 3, abs=1e-6)
    assert errors["ECE with vetoed > 1 px"] == pytest.approx((abs(0.95 + 0.92 - 1) + 0.5) / 4, abs=1e-6)


def test_the_choice_of_the_agreement_is_a_table(
    trained: Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cache = shutil.copytree(trained.store.root, tmp_path / "cache")
    agreement.main(SPEC, cache, window=[9], setting=list(SETTINGS))
    assert "weight 4" in capsys.readouterr().out
    found = json.loads((tmp_path / "build" / "bench" / "agreement.json").read_text())
    assert found["scenes"] == ["train-0", "train-1"]
    assert found["auc, optimal"] - 0.01 <= min(found["auc"]["9"]) and max(found["auc"]["9"]) <= 1
    # Weight 0 is the evaluation-Net alone, as the folds' networks answer.
    result = run(Task(SPEC, settings=SETTINGS, train=True, cache=cache), "calibration")
    areas = []
    for scene in ("train-0", "train-1"):
        truth, scored = result.open("truth", scene), result.find("confidence", scene).step.inputs["disparity"][0]
        disparity = result.store.arrays(result.made[scored].key)["disparity"][...]
        counted = truth["nonocc"].values & np.isfinite(truth["disparity"].values)
        right = np.abs(disparity - truth["disparity"].values) <= 1
        areas.append(auc(result.open("confidence", scene)["network"].values[counted], right[counted]))
    assert found["auc"]["9"][0] == pytest.approx(np.mean(areas), abs=1e-3)


def test_ways_of_training_are_judged_on_scenes_held_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    variant = " ".join(SETTINGS)
    variants = [variant, f"{variant} matching_samples.slots=3", f"{variant} costvolume.mode=fast"]
    recipe.main(SPEC, variants, held=["train-0"], cache=tmp_path / "cache")
    assert "slots=3" in capsys.readouterr().out
    found = json.loads((tmp_path / "build" / "bench" / "recipe.json").read_text())
    assert (found["held"], found["scenes"], len(found["variants"])) == (["train-0"], 1, 3)
    assert all(0 < each["raw_bad"]["train-0"] <= 100 for each in found["variants"].values())


def test_settings_of_the_sums_are_judged_on_scenes_that_no_network_has_seen(tmp_path: Path) -> None:
    few = " ".join((*SETTINGS, "descriptor_net.summed_steps=0", "descriptor_net.width=32"))
    variants = [f"{few} aggregated.median={side}" for side in (1, 3)]
    held_out.main([SPEC], variants, cache=tmp_path / "cache")
    found = json.loads((tmp_path / "build" / "bench" / "held_out.json").read_text())
    plain, smooth = (found["variants"][variant][SPEC] for variant in variants)
    assert [*plain] == [*smooth] == ["train-0", "train-1"] and plain != smooth
    assert all(100 >= errors[0] >= errors[1] >= errors[2] >= errors[3] >= 0 for errors in plain.values())
    keys = {entry.key for entry in Store(tmp_path / "cache").entries() if entry.label["product"] == "descriptor_net"}
    assert len(keys) == 2  # a half each: the second variant takes the first one's volumes


def test_siblings_of_what_is_held_out_are_not_learnt_from() -> None:
    scenes = [replace(open_dataset(TINY).scenes[0], name=name) for name in ("2006/Cloth1", "2006/Cloth2", "2005/Books")]
    tested, learnt = recipe.divide(scenes, ["Cloth2"])
    assert [scene.name for scene in (*tested, *learnt)] == ["2006/Cloth2", "2005/Books"]
    for held in (["Cloth3"], ["Cloth1", "Books"]):
        with pytest.raises(UsageError, match="--held"):
            recipe.divide(scenes, held)


def test_a_head_of_lower_rank_is_judged(tmp_path: Path) -> None:
    low_rank.main(TINY, [8], rows=8)
    found = json.loads((tmp_path / "build" / "bench" / "low_rank.json").read_text())
    few, all_of_them = found["ranks"]
    assert (few["rank"], all_of_them["rank"]) == (8, 128)
    assert few["kernel kept, %"] < 90 and all_of_them["kernel kept, %"] == pytest.approx(100)
    assert few["multiplications, %"] < all_of_them["multiplications, %"] == 100
    assert all(0 <= row["raw error, %"] <= 100 for row in found["ranks"])


def test_a_kernel_of_full_rank_stays_and_one_of_rank_one_has_proportional_filters() -> None:
    net = MatchingNet(1)
    whole, kept = low_rank.truncated(net, 128)
    assert torch.allclose(whole.hidden[0].weight, net.hidden[0].weight, atol=1e-5) and kept == pytest.approx(1)
    least, _ = low_rank.truncated(net, 1)
    assert torch.linalg.matrix_rank(least.hidden[0].weight.reshape(128, -1), rtol=1e-4) == 1


def test_a_time_line_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    timeline.main(TINY, tmp_path / "t.png")
    told = capsys.readouterr().out
    assert all(product in told for product in ("costvolume", "confidence", "metrics"))
    assert (tmp_path / "t.png").stat().st_size > 1000


def test_a_matcher_that_cannot_be_had_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(peers.PeerError, match="there-is-no-such-matcher-0 @ file") as error:
        peers.install(f"there-is-no-such-matcher-0 @ file://{tmp_path}/none.whl", tmp_path / "peers")
    assert "\n" not in str(error.value)


def test_a_ratio_counts_work_and_keeps_its_limit() -> None:
    ratio = compare("a", lambda: None, lambda: None, 1e9, work=2.0, pairs=3)
    assert len(ratio.pairs) == 3 and not ratio.met
    assert Ratio("b", (1.0, 2.0, 9.0), 2.0, at_most=True).met
    assert not Ratio("b", (1.0, 2.1, 9.0), 2.0, at_most=True).met


def test_the_direct_loop_of_the_transforms_is_the_definition() -> None:
    import numpy as np

    gray, out = np.array([[1, 2, 3]], np.uint8), np.empty((1, 3), np.float32)
    transforms.direct_rank(gray, 1, out)
    assert out.tolist() == [[0.5, np.float32(1 / 3), 0.0]]


@pytest.mark.parametrize("error", [UsageError("toml:x: no such file"), FileNotFoundError(2, "No such file", "x.toml")])
def test_a_users_mistake_is_one_line(
    error: Exception, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def main() -> None:
        raise error

    monkeypatch.setattr(sys, "argv", ["benchmark"])
    with pytest.raises(SystemExit) as left:
        as_command(main)
    written = capsys.readouterr()
    assert left.value.code == 2 and written.out == ""
    assert written.err.count("\n") == 1 and "o such file" in written.err


def test_a_fault_of_a_benchmark_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def main() -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(sys, "argv", ["benchmark"])
    with pytest.raises(ZeroDivisionError):
        as_command(main)
