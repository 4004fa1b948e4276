"""The figures by a benchmark's own rules: how they are taken together over scenes, by hand."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import published
from semidense.datasets import open_dataset
from semidense.datasets.scene import Truth
from semidense.pipeline.plan.errors import UsageError

TINY = "synthetic:train=0,test=1,height=48,width=64,disparities=4"


def judged(found: list[float], true: list[float], name: str = "A") -> published.Judged:
    """Return a scene of one row."""
    (source,) = open_dataset(TINY).scenes
    row, truth = np.float32([found]), np.float32([true])
    return published.Judged(replace(source, name=name), Truth(truth, np.ones_like(truth, bool), "exact"), row)


TWO = [judged([10, 10, 10, np.nan], [10, 10, 10, 10]), judged([10, 20], [10, 10])]
"""Three pixels of four reported, none wrong, the gap filled rightly; one of two pixels wrong."""


def test_kitti_2015_counts_the_pixels_of_all_frames_together() -> None:
    figures = published.kitti2015(TWO)
    assert figures == pytest.approx({"D1-all": 100 / 6, "D1-est": 100 / 5, "density": 500 / 6})


def test_kitti_2012_is_a_mean_over_frames() -> None:
    figures = published.kitti2012(TWO)
    assert (figures["out3"], figures["density"], figures["avg"]) == pytest.approx((25, 87.5, 2.5))


def test_eth3d_is_a_mean_over_scenes_of_reported_pixels() -> None:
    figures = published.eth3d([judged([1, 1, 1, np.nan], [1, 1, 1, 1]), judged([1, 2], [1, 1])])
    assert (figures["bad0.5"], figures["coverage"]) == pytest.approx((50 / 2, 87.5))


def test_the_command_prints_and_writes_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    published.main("eth3d", TINY, setting=["semidense.R=0.5"], cache=tmp_path / "cache")
    found = json.loads((tmp_path / "build" / "bench" / "published.json").read_text())
    assert (found["benchmark"], found["form"], found["scenes"]) == ("eth3d", "sparse", 1)
    assert 0 <= found["figures"]["bad1.0"] <= 100


def test_a_benchmark_that_is_not_known_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"'eth4d'.*eth3d"):
        published.main("eth4d", TINY, cache=tmp_path)
