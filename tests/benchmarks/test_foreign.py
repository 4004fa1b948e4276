"""The table of other matchers' maps, and the maps that Pandora's environment gives it."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import typer

from benchmarks import foreign, kinds, pandora
from benchmarks.peers import PeerError
from semidense.datasets import open_dataset
from semidense.stages.evaluation.evidence.foreign.declaration import KINDS, ForeignNetParams, OfForeignSamples
from semidense.stages.evaluation.evidence.foreign.train import train_foreign_net
from semidense.stages.stage import Network

TINY = "synthetic:train=0,test=1,height=48,width=64,disparities=4"
STAND_IN = """
import sys
import numpy as np
folder, _ = sys.argv[1:]
given = np.load(f"{folder}/pair.npz")
size, (first, last) = given["left"].shape, given["disparities"]
valid = np.arange(size[1]) >= 8
np.savez(f"{folder}/found.npz", disparity=np.full(size, last), valid=np.tile(valid, (size[0], 1)),
         ambiguity=np.ones(size, np.float32), risk=np.zeros(size, np.float32))
"""


def test_views_that_agree_differ_by_nothing() -> None:
    left = np.float32([[0, 1, 1, np.nan, 9]])
    right = np.float32([[0, 3, 5, 5, 5]])
    assert foreign._difference(left, right).tolist() == [[0, 1, 2, np.inf, np.inf]]


def test_pandoras_maps_go_into_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(pandora, "_PAIR", STAND_IN)
    (scene,) = open_dataset(TINY).scenes
    found = pandora.match(Path(sys.executable), scene, tmp_path / "work")
    assert np.isnan(found["checked"][:, :8]).all() and np.isfinite(found["disparity"]).all()
    pandora.write(found, scene.name, tmp_path)
    read = foreign.read_pandora(scene, tmp_path)
    np.testing.assert_array_equal(read.checked, found["checked"])
    foreign.main(TINY, ["sgm", "pandora"], tmp_path)
    _, *rows = (line.split() for line in capsys.readouterr().out.splitlines())
    assert [row[0] for row in rows] == ["sgm", "pandora", "sgm,", "pandora,"]
    by_matcher = {row[0]: dict(zip(foreign.COLUMNS, map(float, row[2:]), strict=True)) for row in rows[:2]}
    assert np.isnan(by_matcher["sgm"]["risk"]) and np.isnan(by_matcher["pandora"]["views"])
    for row in by_matcher.values():
        assert row["perfect"] <= min(row[name] for name in ("net", "left", "both"))
        assert row["least 70"] <= min(row["left 70"], row["both 70"])
    # A measure that tells nothing leaves the share of wrong pixels as it is, at every density.
    wrong = pandora.figures(scene, found)[0]
    assert np.isclose(100 * by_matcher["pandora"]["risk"], wrong, atol=0.05)


@pytest.mark.parametrize(("matcher", "said"), [("raft", "no matcher is called raft: choose"), ("pandora", "--pandora")])
def test_a_matcher_that_cannot_be_scored_is_refused(matcher: str, said: str) -> None:
    with pytest.raises(typer.BadParameter, match=said):
        foreign.main(TINY, [matcher])


def test_a_pandora_that_does_not_run_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pandora, "_PAIR", "raise SystemExit('no plugin')")
    (scene,) = open_dataset(TINY).scenes
    with pytest.raises(PeerError, match=r"Pandora fails on .*no plugin$"):
        pandora.match(Path(sys.executable), scene, tmp_path / "work")


def test_each_kind_of_map_is_scored_by_a_net_of_other_scenes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("cv2", reason="needs the extra baselines")
    monkeypatch.chdir(tmp_path)
    learnt: list[int] = []

    def train(params: ForeignNetParams, inputs: OfForeignSamples) -> Network:
        learnt.append(len(inputs["foreign_samples"]))
        return train_foreign_net(params, inputs)

    monkeypatch.setattr(kinds, "train_foreign_net", train)
    settings = ["foreign_net.steps=2", "foreign_samples.crops=1", "foreign_samples.height=32"]
    kinds.main("synthetic:train=3,test=0,height=48,width=64,disparities=4", tmp_path / "cache", settings)
    assert learnt == [2, 2, 2]
    printed = capsys.readouterr().out
    assert all(kind in printed for kind in KINDS)
    found = json.loads((tmp_path / "build" / "bench" / "kinds.json").read_text())
    assert len(found["scenes"]) == 3 and list(found["means"]) == [*KINDS, "mean"]
    for wrong, *areas, perfect in found["means"].values():
        assert 0 <= wrong <= 100 and all(perfect - 1e-9 <= area <= 1 for area in areas)
