"""The archives in the layouts that the servers publish, and what breaks their rules."""

import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semidense.datasets import DisparityRange, SceneSource, read_pfm, read_png16
from semidense.pipeline.files.submissions.archive import (
    LAYOUTS,
    forms_of,
    layout_of,
    require_complete,
    write_archive,
)
from semidense.pipeline.files.submissions.solved import Form, Map, Solved
from semidense.pipeline.plan.errors import UsageError
from semidense.stages.metrics.middlebury import WEIGHTS

DENSE = np.arange(48, dtype=np.float32).reshape(6, 8) / 4
SPARSE = np.where(DENSE > 3, DENSE, np.float32(np.nan))
TEST = (
    "Australia AustraliaP Bicycle2 Classroom2 Classroom2E Computer Crusade CrusadeP Djembe DjembeL Hoops Livingroom "
    "Newkuba Plants Staircase"
)  # fmt: skip


def scene_of(name: str, has_truth: bool = False) -> SceneSource:
    files = {"left": Path("/data/MiddEval3") / name / "im0.png"}
    return SceneSource(name, "d", "test", (6, 8), DisparityRange(0, 20), "none", files, has_truth=has_truth)


def solved_of(name: str, seconds: float = 1.25, **maps: Map) -> Solved:
    found: dict[Form, Map] = {form: maps[form] for form in ("dense", "sparse") if form in maps}  # type: ignore[misc]
    return Solved(scene_of(name), found, seconds)


def names_in(path: Path) -> set[str]:
    with zipfile.ZipFile(path) as archive:
        return set(archive.namelist())


def test_middlebury_gets_dense_and_sparse_maps_and_a_time(tmp_path: Path) -> None:
    path = tmp_path / "a.zip"
    written = write_archive(
        LAYOUTS["middlebury"], [solved_of("testQ/Plants", dense=DENSE, sparse=SPARSE)], "Mine", path
    )
    folder = "testQ/Plants"
    assert names_in(path) == {f"{folder}/disp0Mine.pfm", f"{folder}/disp0Mine_s.pfm", f"{folder}/timeMine.txt"}
    assert (written.files, written.seconds) == (3, 1.25)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
    np.testing.assert_array_equal(read_pfm(tmp_path / folder / "disp0Mine.pfm"), DENSE)
    np.testing.assert_array_equal(read_pfm(tmp_path / folder / "disp0Mine_s.pfm"), SPARSE)
    assert float((tmp_path / folder / "timeMine.txt").read_text()) == 1.25


def test_kitti_gets_a_16_bit_png_a_frame(tmp_path: Path) -> None:
    write_archive(LAYOUTS["kitti2015"], [solved_of("000007_10", sparse=SPARSE)], "Mine", tmp_path / "a.zip")
    assert names_in(tmp_path / "a.zip") == {"disp_0/000007_10.png"}
    with zipfile.ZipFile(tmp_path / "a.zip") as archive:
        archive.extractall(tmp_path)
    np.testing.assert_array_equal(read_png16(tmp_path / "disp_0/000007_10.png"), SPARSE)


def test_eth3d_gets_a_map_and_its_runtime(tmp_path: Path) -> None:
    write_archive(LAYOUTS["eth3d"], [solved_of("two_view_test/lakeside_1l", sparse=SPARSE)], "Mine", tmp_path / "a.zip")
    assert names_in(tmp_path / "a.zip") == {"low_res_two_view/lakeside_1l.pfm", "low_res_two_view/lakeside_1l.txt"}
    with zipfile.ZipFile(tmp_path / "a.zip") as archive:
        assert archive.read("low_res_two_view/lakeside_1l.txt") == b"runtime 1.250\n"


@pytest.mark.parametrize(
    "benchmark, solved, message",
    [
        ("middlebury", solved_of("testQ/Plants", dense=SPARSE), "pixels have no disparity; submit the sparse form"),
        ("middlebury", solved_of("testQ/Plants", sparse=DENSE[:, :7]), "but the image has"),
        ("middlebury", solved_of("testQ/Plants", dense=DENSE - 1), "takes none below 0"),
        ("middlebury", solved_of("testQ/Plants", sparse=SPARSE * np.nan), "have no disparity"),
        ("middlebury", solved_of("testQ/Plants", seconds=0, dense=DENSE), "is no time in seconds"),
        ("middlebury", solved_of("testQ/Plants", seconds=float("nan"), dense=DENSE), "is no time in seconds"),
        ("middlebury", solved_of("2014/Plants", dense=DENSE), "not of MiddEval3"),
        ("kitti2015", solved_of("000007_10", sparse=SPARSE[:5]), "but the image has"),
        ("eth3d", solved_of("lakeside_1l", seconds=-1, sparse=SPARSE), "is no time in seconds"),
    ],
)
def test_what_breaks_the_rules_is_refused_and_no_archive_is_left(
    tmp_path: Path, benchmark: str, solved: Solved, message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        write_archive(LAYOUTS[benchmark], [solved], "Mine", tmp_path / "a.zip")
    assert list(tmp_path.iterdir()) == []


def test_a_method_and_scenes_need_names_that_are_files(tmp_path: Path) -> None:
    solved = solved_of("000007_10", sparse=SPARSE)
    with pytest.raises(UsageError, match="letters, digits"):
        write_archive(LAYOUTS["kitti2015"], [solved], "../x", tmp_path / "a.zip")
    other = replace(solved, scene=scene_of("training/000007_10"))
    with pytest.raises(UsageError, match="both 000007_10 and training/000007_10 have that name"):
        write_archive(LAYOUTS["kitti2015"], [solved, other], "Mine", tmp_path / "a.zip")


TRAINING_SCENES = [scene_of(f"trainingH/{name}", True) for name in WEIGHTS]
TEST_SCENES = [scene_of(f"testH/{name}") for name in TEST.split()]
FRAMES = [scene_of(f"{number:06}_10") for number in range(200)]


@pytest.mark.parametrize(
    "benchmark, scenes",
    [
        ("middlebury", TRAINING_SCENES),
        ("middlebury", TRAINING_SCENES + TEST_SCENES),
        ("kitti2015", FRAMES),
        ("eth3d", [scene_of(f"two_view_test/{number}") for number in range(20)]),
    ],
)
def test_a_complete_set_lacks_nothing(benchmark: str, scenes: list[SceneSource]) -> None:
    assert require_complete(LAYOUTS[benchmark], scenes, partial=False) is None


@pytest.mark.parametrize(
    "benchmark, scenes, message",
    [
        ("middlebury", TRAINING_SCENES[1:], "without trainingH: Adirondack;"),
        ("middlebury", TEST_SCENES, "without trainingH: Adirondack, ArtL"),
        ("middlebury", TRAINING_SCENES + TEST_SCENES[1:], "without testH: Australia;"),
        ("middlebury", [*TRAINING_SCENES, scene_of("trainingQ/Teddy")], "of the sizes H and Q together"),
        ("kitti2015", FRAMES[1:], "without 1 of the 200 frames, 000000_10 first"),
        ("kitti2015", [scene_of("000000_10", True)], "frames of training"),
        ("eth3d", [scene_of("a")], "with 1 of the 20 scenes of two_view_test"),
    ],
)
def test_what_a_set_lacks_is_told(benchmark: str, scenes: list[SceneSource], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        require_complete(LAYOUTS[benchmark], scenes, partial=False)
    assert require_complete(LAYOUTS[benchmark], scenes, partial=True)


def test_forms_and_benchmarks_have_names() -> None:
    assert forms_of(LAYOUTS["middlebury"], None) == ("dense", "sparse")
    assert forms_of(LAYOUTS["kitti2015"], None) == ("sparse",)
    assert forms_of(LAYOUTS["eth3d"], "dense") == ("dense",)
    with pytest.raises(UsageError, match="did you mean sparse"):
        forms_of(LAYOUTS["eth3d"], "sparce")
    with pytest.raises(UsageError, match="did you mean kitti2015"):
        layout_of("kitti2012")
