"""Every loader against the published files."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from semidense.datasets.arrays import DisparityMap, Mask
from semidense.datasets.benchmarks.copies.check import check_scene
from semidense.datasets.formats.pfm import read_pfm
from semidense.datasets.occlusion import warped_truth_mask
from semidense.datasets.registry import Dataset, open_dataset
from semidense.stages.metrics.eth3d import eth3d_figures
from semidense.stages.metrics.kitti import d1_counts, d1_figures, kitti2012_figures
from semidense.stages.metrics.middlebury import middlebury_figures

PATHS = {"middlebury": "middlebury", "kitti2012": "kitti2012", "kitti2015": "kitti2015", "eth3d": "eth3d"}
WRONG_SCALES = (-1, 0, 0.25, 0.5, 0.9, 1.1, 2, 4)
SAMPLES = [
    pytest.param("middlebury", "2001/Tsukuba", "published", id="scale 16"),
    pytest.param("middlebury", "2001/Bull", "left-right check", id="scale 8"),
    pytest.param("middlebury", "2003/Cones", "published", id="scale 4"),
    pytest.param("middlebury", "Reindeer", "left-right check", id="2005, scale 3"),
    pytest.param("middlebury", "Aloe", "left-right check", id="2006, scale 3"),
    pytest.param("middlebury", "trainingQ/Teddy", "published", id="PFM with an odd scale line"),
    pytest.param("middlebury", "Motorcycle", "published", id="PFM"),
    pytest.param("kitti2012", "000007_10", "non-occluded truth", id="sparse, gray"),
    pytest.param("kitti2015", "000005_10", "non-occluded truth", id="sparse"),
    pytest.param("eth3d", "playground_1l", "warped truth", id="gray"),
]


@pytest.fixture(scope="module")
def benchmarks(stereo_data: Path) -> dict[str, Dataset]:
    return {name: open_dataset(f"{name}:{stereo_data / path}") for name, path in PATHS.items()}


def test_all_185_scenes_are_found_and_split(benchmarks: dict[str, Dataset]) -> None:
    scenes = [scene for dataset in benchmarks.values() for scene in dataset.scenes]
    assert Counter((scene.dataset, scene.split) for scene in scenes) == {
        ("middlebury/MiddEval3", "test"): 23,
        ("middlebury/2001", "train"): 7,
        ("middlebury/2003", "train"): 1,
        ("middlebury/2005", "train"): 5,
        ("middlebury/2006", "train"): 16,
        ("kitti2012", "train"): 116,
        ("kitti2015", "test"): 16,
        ("eth3d", "test"): 1,
    }
    assert sum(scene.has_truth for scene in scenes) == 185 - 15


def test_every_scene_loads_and_its_truth_lies_in_its_range_and_scores_0(benchmarks: dict[str, Dataset]) -> None:
    for kind, dataset in benchmarks.items():
        for source in dataset.scenes:
            truth = source.load().truth
            if truth is not None:
                assert source.disparities.minimum <= np.nanmin(truth.disparity), source.name
                assert np.nanmax(truth.disparity) <= source.disparities.maximum, source.name
                assert 0.5 < truth.nonocc.sum() / (~np.isnan(truth.disparity)).sum() <= 1, source.name
                judge(kind, truth.disparity, truth.nonocc, source.disparities.maximum)


@pytest.mark.parametrize("benchmark, name, mask", SAMPLES)
def test_truth_carries_right_onto_left(
    benchmarks: dict[str, Dataset],
    warp_correlation: Callable[..., float],
    benchmark: str,
    name: str,
    mask: str,
) -> None:
    scene = benchmarks[benchmark].select([name]).scenes[0].load()
    assert scene.truth is not None
    assert scene.truth.mask == mask
    assert warp_correlation(scene) > 0.93
    assert warp_correlation(scene) > max(warp_correlation(scene, scale) for scale in WRONG_SCALES)


@pytest.mark.parametrize("benchmark, name", [(sample.values[0], sample.values[1]) for sample in SAMPLES])
def test_a_copy_passes_the_check(benchmarks: dict[str, Dataset], benchmark: str, name: str) -> None:
    found = check_scene(benchmarks[benchmark].select([name]).scenes[0])
    assert (found.problems, found.scale) == ((), 1)
    assert found.fit is not None and found.fit > 0.6


@pytest.mark.parametrize("name", ["trainingQ/Teddy", "Motorcycle", "2003/Cones"])
def test_the_warped_truth_comes_near_the_published_mask(benchmarks: dict[str, Dataset], name: str) -> None:
    truth = benchmarks["middlebury"].select([name]).scenes[0].load_truth()
    assert truth is not None
    known = ~np.isnan(truth.disparity)
    assert (warped_truth_mask(truth.disparity) == truth.nonocc)[known].mean() > 0.97


def test_the_rendered_pair_has_spaces_in_its_pfm_header(stereo_data: Path) -> None:
    truth = read_pfm(stereo_data / "sceneflow" / "flyingthings_0032_0006" / "disp0.pfm")
    assert truth.shape == (540, 960)
    assert (round(float(np.nanmin(truth))), round(float(np.nanmax(truth)))) == (1, 130)


def judge(kind: str, truth: DisparityMap, visible: Mask, largest: int) -> None:
    """Judge a truth against itself by the figures of its benchmark."""
    everywhere = np.ones_like(visible)
    for mask in (visible, everywhere):
        if kind == "middlebury":
            figures = middlebury_figures(truth, truth, mask, largest, 4.0)
            assert (figures["totbad0.5"], figures["avgerr"], figures["A99"]) == (0, 0, 0)
        if kind == "eth3d":
            figures = eth3d_figures(truth, truth, mask)
            assert (figures["bad0.5"], figures["rms"], figures["coverage"]) == (0, 0, 100)
    if kind == "kitti2012":
        assert set(kitti2012_figures(truth, truth).values()) == {0, 100}
    if kind == "kitti2015":
        figures = d1_figures(d1_counts(truth, truth))
        assert (figures["D1-all"], figures["D1-est"], figures["density"]) == (0, 0, 100)
