"""A user's own pair through ``pipeline.match``, with the shipped weights on a few pixels."""

import json
import pickle
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image
from plyfile import PlyData

from semidense import pipeline
from semidense.datasets import DatasetError, open_dataset, read_pfm, read_png16
from semidense.datasets.pairs.options import PairOptions, pair_spec
from semidense.pipeline.api import Task, run, status
from semidense.pipeline.pairs.match import Match, match, match_all
from semidense.pipeline.pairs.match_files import save, save_all, summary
from semidense.pipeline.pairs.wishes import Wishes
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.presets import PRESETS
from semidense.stages.stage import StageError

SCENE = "synthetic:train=0,test=1,height=64,width=80,disparities=8"
CALIB = (
    "cam0=[100 0 30; 0 100 20; 0 0 1]\ncam1=[100 0 32; 0 100 20; 0 0 1]\n"
    "doffs=2\nbaseline=50\nwidth=80\nheight=64\nndisp=9\n"
)
WISHES: dict[str, Any] = {"density": 0.5, "left_right": True, "subpixel": True, "right_view": True}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two pictures, their calibration and a cache."""
    folder = tmp_path_factory.mktemp("garden")
    scene = open_dataset(SCENE).scenes[0].load()
    for name, view in (("left", scene.left), ("right", scene.right)):
        Image.fromarray(view).save(folder / f"{name}.png")
    (folder / "calib.txt").write_text(CALIB)
    return folder


@pytest.fixture(scope="module")
def found(folder: Path) -> Match:
    files = folder / "left.png", folder / "right.png"
    return match(*files, calib=folder / "calib.txt", cache=folder / "cache", **WISHES)


def test_the_map_is_what_was_asked_for(found: Match) -> None:
    assert (found.scene.name[:6], found.wishes.product) == ("garden", "refined")
    assert found.disparity.dtype == np.float32
    known = np.isfinite(found.disparity)
    assert 0.2 < known.mean() <= 0.55, "half of the pixels at most, less those that the right view contradicts"
    assert (found.disparity[known] % 1 != 0).any(), "between whole pixels"
    assert found.confidence[known].min() >= found.R
    assert (found.disparities.minimum, found.disparities.maximum) == (0, 8)
    assert np.abs(found.disparity[known] - found.raw[known]).max() <= 0.5
    assert found.right_disparity.shape == found.disparity.shape
    assert found.warnings == []


def test_most_of_what_is_kept_is_right(found: Match) -> None:
    truth = open_dataset(SCENE).scenes[0].load_truth()
    assert truth is not None
    known = np.isfinite(found.disparity)
    assert np.mean(np.abs(found.disparity - truth.disparity)[known] > 1) < 0.1


def test_depth_and_points_follow_the_calibration(found: Match) -> None:
    known = np.isfinite(found.disparity)
    assert np.allclose(found.depth[known], 0.05 * 100 / (found.disparity[known] + 2))
    points, colours = found.points()
    assert len(points) == known.sum() == len(colours)
    assert np.array_equal(colours, found.image[known])
    rows, columns = np.nonzero(known)
    assert np.allclose(points[:, 0] / -points[:, 2] * 100 + 30, columns, atol=1e-3)
    assert np.allclose(-points[:, 1] / -points[:, 2] * 100 + 20, rows, atol=1e-3)


def test_it_can_be_pickled(found: Match) -> None:
    again = pickle.loads(pickle.dumps(found))
    assert np.array_equal(again.disparity, found.disparity, equal_nan=True)


def test_a_second_call_makes_nothing(folder: Path, found: Match) -> None:
    files = folder / "left.png", folder / "right.png"
    again = match(*files, calib=folder / "calib.txt", cache=folder / "cache", **WISHES)
    assert all(made.reused for result in (again.result, *again.others) for made in result.made.values())
    assert np.array_equal(again.disparity, found.disparity, equal_nan=True)


def test_arrays_give_the_same_map_and_their_products_are_shared(folder: Path, found: Match) -> None:
    left, right = (np.asarray(Image.open(folder / f"{name}.png")) for name in ("left", "right"))
    given = match(left, right, d_min=0, d_max=8, cache=folder / "cache", **WISHES)
    assert np.array_equal(given.disparity, found.disparity, equal_nan=True)
    assert given.made("costvolume").reused, "the same content, however it came"
    with pytest.raises(UsageError, match="needs a calibration"):
        _ = given.depth


def test_the_preset_is_robust_unless_another_is_named(folder: Path, found: Match) -> None:
    options = {"d_min": 0, "d_max": 8, "cache": folder / "cache"}
    files = folder / "left.png", folder / "right.png"
    assert np.mean(found.raw[np.isfinite(found.raw)] % 1 != 0) > 0.5, "refined below a pixel without being asked"
    named = match(*files, **options, preset="robust")
    assert np.array_equal(named.raw, found.raw, equal_nan=True)
    paper = match(*files, **options, preset="paper")
    assert np.isfinite(paper.raw).any()
    assert (paper.raw[np.isfinite(paper.raw)] % 1 == 0).all(), "the winner of single costs is a whole disparity"
    assert paper.made("costvolume").key != found.made("costvolume").key
    set_back = match(*files, **options, settings=["aggregated.subpixel=false"])
    assert (set_back.raw[np.isfinite(set_back.raw)] % 1 == 0).all(), "a setting refines the preset"


@pytest.mark.parametrize("wish", [{"max_error": 0.02}, {"calibrated": True}], ids=["an error", "probabilities"])
def test_maps_without_a_calibration_are_told_before_anything_is_made(
    folder: Path, tmp_path: Path, wish: dict[str, Any]
) -> None:
    files, indoor = (folder / "left.png", folder / "right.png"), {"settings": ["training.weights=indoor"]}
    with pytest.raises(StageError, match=r"no calibration of .*evidence_confidence .*take a preset as it is"):
        match(*files, d_min=0, d_max=8, cache=tmp_path / "cache", **indoor, **wish)
    assert not (tmp_path / "cache").exists()
    with pytest.raises(StageError, match="no calibration of"):
        pipeline.StereoMatcher(0, 9, **indoor, **wish)
    for preset in PRESETS:
        found = match(*files, d_min=0, d_max=8, cache=folder / "cache", preset=preset, **wish)
        assert found.expected_error is not None


def test_a_pair_is_a_dataset_like_any_other(folder: Path, found: Match) -> None:
    spec = f"pair:{folder}/left.png,{folder}/right.png,d_min=0,d_max=8"
    plan = status(Task(spec, cache=folder / "cache", preset="robust"), "confidence")
    assert plan.todo() == ()


def test_an_open_range_is_estimated_once_and_told(folder: Path, found: Match) -> None:
    task = Task(f"pair:{folder}/left.png,{folder}/right.png", cache=folder / "cache")
    result = run(task, "images")
    assert [planned.step.product for planned in result.plan.steps] == ["images"]
    plan = status(task, "costvolume")
    (note,) = plan.notes
    assert "estimated from the images" in note
    settings = plan.steps[-1].step.settings
    assert settings["d_min"] <= 1
    assert 7 <= settings["d_max"] < 20


def test_before_the_survey_a_plan_stops_there(folder: Path, tmp_path: Path) -> None:
    plan = status(Task(f"pair:{folder}/left.png,{folder}/right.png", cache=tmp_path / "cache"), "semidense")
    assert [planned.step.product for planned in plan.steps] == ["images", "survey"]
    assert "estimated first" in plan.notes[0]
    assert not (tmp_path / "cache").exists()


def test_a_range_that_nothing_tells_is_refused(tmp_path: Path) -> None:
    flat = np.full((40, 50), 7, np.uint8)
    with pytest.raises(
        UsageError, match=r"too little in the two images agrees .* give both ends, as in --min-disp 0 --max-disp 49"
    ):
        match(flat, flat, cache=tmp_path)


def test_holes_are_filled_and_told_apart(folder: Path, found: Match) -> None:
    options = {"calib": folder / "calib.txt", "cache": folder / "cache"}
    filled = match(folder / "left.png", folder / "right.png", **options, **WISHES, fill=True)
    assert filled.density == 1
    assert np.array_equal(filled.guessed, np.isnan(found.disparity))
    assert np.array_equal(filled.disparity[~filled.guessed], found.disparity[~filled.guessed])


@pytest.mark.parametrize(
    ("wishes", "message"),
    [
        pytest.param({"R": 0.5, "density": 0.5}, "give one of them", id="R and a density"),
        pytest.param({"R": 1.5}, "semidense.R = 1.5", id="R above 1"),
        pytest.param({"density": 0.0}, "semidense.density", id="nothing to keep"),
        pytest.param({"left_right": True, "tolerance": -1}, "refined.tolerance", id="a negative tolerance"),
    ],
)
def test_wishes_that_cannot_be_are_refused(folder: Path, wishes: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        match(folder / "left.png", folder / "right.png", d_min=0, d_max=4, cache=folder / "cache", **wishes)


@pytest.fixture(scope="module")
def saved(found: Match, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("saved") / "out"
    save(found, folder)
    return folder


def test_every_file_is_there_and_told(found: Match, saved: Path) -> None:
    about = json.loads((saved / "summary.json").read_text())
    told = {each["file"] for each in about["files"]}
    assert {path.name for path in saved.iterdir()} == told | {"summary.json"}
    maps = ("disparity", "disparity_raw", "confidence", "depth", "right_disparity")
    assert {f"{name}.{ending}" for name in maps for ending in ("pfm", "png", "tif", "npy")} <= told
    for each in about["files"]:
        assert each["reference view"] == ("right" if each["file"].startswith("right") else "left")
    assert about["density_percent"] == 100 * found.density
    assert np.array_equal(np.load(saved / "disparity_raw.npy"), found.raw, equal_nan=True)
    assert about["seconds"]["costvolume"] > 0
    assert about["versions"]["torch"]


@pytest.mark.parametrize(("name", "scale"), [("disparity", 256), ("confidence", 65535), ("depth", 1000)])
def test_every_format_comes_back_within_its_precision(found: Match, saved: Path, name: str, scale: int) -> None:
    values = getattr(found, name)
    assert np.array_equal(read_pfm(saved / f"{name}.pfm"), values, equal_nan=True)
    assert np.array_equal(np.load(saved / f"{name}.npy"), values, equal_nan=True)
    assert np.array_equal(tifffile.imread(saved / f"{name}.tif"), values, equal_nan=True)
    pfm = cv2.imread(str(saved / f"{name}.pfm"), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(np.where(np.isinf(pfm), np.nan, pfm), values, equal_nan=True)
    stored = cv2.imread(str(saved / f"{name}.png"), cv2.IMREAD_UNCHANGED)
    assert stored.dtype == np.uint16
    known = np.isfinite(values)
    assert np.array_equal(stored > 0, known)
    assert np.abs(stored[known] / scale - values[known]).max() <= max(
        0.5 / scale + 1e-6, 1 / scale * (values[known].min() < 0.5 / scale)
    )


def test_the_kitti_picture_is_read_by_the_kitti_reader(found: Match, saved: Path) -> None:
    read = read_png16(saved / "disparity.png")
    assert np.nanmax(np.abs(read - found.disparity)) <= 1 / 256


def test_files_say_what_they_hold(saved: Path) -> None:
    texts = Image.open(saved / "disparity.png").text
    assert texts["scale"] == "value = stored / 256"
    assert texts["none"] == "0"
    assert texts["reference view"] == "left"
    with tifffile.TiffFile(saved / "depth.tif") as file:
        assert json.loads(file.pages[0].tags["ImageDescription"].value)["unit"] == "m"


def test_the_cloud_is_read_by_another_reader(found: Match, saved: Path) -> None:
    vertex = PlyData.read(saved / "points.ply")["vertex"]
    points, _ = found.points()
    assert np.array_equal(np.stack([vertex[axis] for axis in "xyz"], axis=1), points)
    assert (vertex["z"] < 0).all(), "before the camera, which looks along -z as viewers do"


def test_a_picture_that_cannot_hold_the_values_is_left_out_and_told(folder: Path, tmp_path: Path) -> None:
    left, right = (np.asarray(Image.open(folder / f"{name}.png")) for name in ("left", "right"))
    swapped = match(right, left, d_min=-8, d_max=0, R=0.0, cache=folder / "cache")
    about = save(swapped, tmp_path / "out", ["png", "npy"])
    assert "disparity.png was not written: values from -7." in about["notes"][0]
    assert (tmp_path / "out" / "disparity.npy").is_file()
    assert not (tmp_path / "out" / "disparity.png").exists()


def test_a_folder_that_cannot_be_written_gets_nothing(
    found: Match, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("semidense.pipeline.pairs.match_files.write_ply", full)
    with pytest.raises(UsageError, match="No space left"):
        save(found, tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


def test_a_second_match_leaves_nothing_of_the_first(folder: Path, found: Match, tmp_path: Path) -> None:
    out = tmp_path / "out"
    save(found, out)
    (out / "notes.txt").write_text("mine")
    summary = json.loads((out / "summary.json").read_text())
    summary["files"] += [{"file": "notes.txt"}, {"file": "../folder"}]
    (out / "summary.json").write_text(json.dumps(summary))
    plain = match(folder / "left.png", folder / "right.png", d_min=0, d_max=8, cache=folder / "cache")
    about = save(plain, out, ["npy"])
    told = {each["file"] for each in about["files"]} | {"summary.json"}
    assert {path.name for path in out.iterdir()} == told | {"notes.txt"}, "depth of another match would deceive"


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"files": 3}', '{"files": [{}]}', "\x00", '{"files": [{"file": []}]}']
)
def test_a_summary_of_something_else_is_kept(found: Match, tmp_path: Path, text: str) -> None:
    (tmp_path / "summary.json").write_text(text)
    with pytest.raises(UsageError, match="was not written by an earlier command"):
        save(found, tmp_path, ["npy"])
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]
    assert (tmp_path / "summary.json").read_text() == text


def test_several_pairs_get_a_folder_each(folder: Path, found: Match, tmp_path: Path) -> None:
    (folder / "pairs.csv").write_text("left.png,right.png\nright.png,left.png\n")
    spec = f"pair:{folder}/pairs.csv,d_min=-8,d_max=8"
    pairs = match_all(Task(spec, cache=folder / "cache"), Wishes(R=0.5))
    summaries = save_all(pairs, tmp_path / "out", ["npy"])
    assert len({each["folder"] for each in summaries}) == 2
    assert {path.name for path in (tmp_path / "out").iterdir()} == {Path(each["folder"]).name for each in summaries}
    assert "exchanged" not in " ".join(pairs[0].warnings)


def test_the_opencv_users_drop_in(folder: Path, found: Match) -> None:
    left, right = (cv2.imread(str(folder / f"{name}.png")) for name in ("left", "right"))
    matcher = pipeline.StereoMatcher.create(0, 9, cache=folder / "cache", **WISHES)
    with pytest.raises(UsageError, match="before compute"):
        _ = matcher.confidence
    made = matcher.compute(left, right)
    assert made.dtype == np.float32
    assert np.array_equal(made, found.disparity, equal_nan=True), "blue, green, red as OpenCV has it"
    assert np.array_equal(matcher.confidence, found.confidence)
    assert (matcher.getMinDisparity(), matcher.getNumDisparities()) == (0, 9)
    with pytest.raises(UsageError, match="numDisparities is 0"):
        pipeline.StereoMatcher(0, 0)


def test_a_match_on_a_cluster_is_surveyed_there_too(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(
        "semidense.pipeline.pairs.match.run", lambda _, product, **how: asked.append((product, how["scheduler"]))
    )
    spec = pair_spec([str(folder / "left.png"), str(folder / "right.png")], PairOptions())
    match_all(Task(spec), Wishes(right_view=True), scheduler="tcp://a:1")
    assert asked == [(product, "tcp://a:1") for product in ("survey", "semidense", "right_disparity")]


def test_two_folders_are_not_one_pair(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no such file or folder"):
        match(tmp_path / "none", folder / "right.png")


def test_folders_of_several_pairs_are_refused_before_any_is_matched(folder: Path, tmp_path: Path) -> None:
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        for name in ("a.png", "b.png"):
            shutil.copy(folder / f"{side}.png", tmp_path / side / name)
    with pytest.raises(UsageError, match="are 2 pairs"):
        match(tmp_path / "left", tmp_path / "right", d_max=8, cache=tmp_path / "cache")
    assert not (tmp_path / "cache").exists()


def test_settings_may_be_a_mapping_and_their_wishes_are_told(folder: Path) -> None:
    files = folder / "left.png", folder / "right.png"
    one, other = (
        match(*files, calib=folder / "calib.txt", cache=folder / "cache", **how)
        for how in ({"settings": {"semidense.max_error": 0.1}}, {"max_error": 0.1})
    )
    assert np.array_equal(one.disparity, other.disparity, equal_nan=True)
    told = summary(one)
    assert (told["R_from"], told["R_basis"]) == ("for the error asked for", summary(other)["R_basis"])
    half = match(*files, calib=folder / "calib.txt", cache=folder / "cache", settings="semidense.density=0.5")
    assert summary(half)["R_from"] == "from the pair's own confidences, for the density asked for"


def test_a_map_below_a_pixel_is_not_refined_by_single_costs(folder: Path, found: Match) -> None:
    files, options = (folder / "left.png", folder / "right.png"), {"calib": folder / "calib.txt"}
    made = match(*files, **options, cache=folder / "cache", subpixel=True)
    known = np.isfinite(made.disparity)
    assert np.array_equal(made.disparity[known], made.raw[known])
    whole = match(*files, **options, cache=folder / "cache", subpixel=True, settings=["aggregated.subpixel=false"])
    known = np.isfinite(whole.disparity)
    assert (whole.raw[known] % 1 == 0).all() and (whole.disparity[known] % 1 != 0).any()


def test_importing_the_verb_stays_light(project: Path) -> None:
    code = "import sys, pipeline; pipeline.match; print(*({'torch', 'zarr', 'matplotlib', 'cv2'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], cwd=project, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_a_calibration_does_not_cut_off_negative_disparities(folder: Path) -> None:
    (folder / "ahead.txt").write_text(CALIB.replace("doffs=2", "doffs=0").replace("100 0 32", "100 0 30"))
    files = folder / "right.png", folder / "left.png"
    found = match(*files, calib=folder / "ahead.txt", cache=folder / "cache")
    assert found.disparities.minimum <= -6
    assert found.disparities.maximum == 8, "the calibration's end stays"
    assert np.median(found.raw[:, 16:64]) < -1
    assert "exchanged" in found.warnings[0]
    save(found, folder / "exchanged", ["npy"])
    assert (folder / "exchanged" / "survey.png").is_file()


def test_a_blank_region_is_told_without_a_picture_of_matches(folder: Path, tmp_path: Path) -> None:
    left, right = (np.array(Image.open(folder / f"{name}.png")) for name in ("left", "right"))
    left[20:44], right[20:44] = 255, 255
    found = match(left, right, d_min=0, d_max=8, cache=folder / "cache")
    silent = (24 + 2 * 6) / 64  # the rows painted over, and the margin of 6 px around them
    assert [line.partition("is blank")[0] for line in found.warnings] == [f"{100 * silent:.0f} % of the left view "]
    assert not np.isfinite(found.disparity[24:40]).any()
    save(found, tmp_path / "out", ["npy"])
    assert not (tmp_path / "out" / "survey.png").exists(), "it shows matches, of which there are none in the region"


def test_what_contradicts_itself_in_the_calibration_is_told(folder: Path) -> None:
    (folder / "odd.txt").write_text(CALIB.replace("cam1=[100 0 32; 0 100 20", "cam1=[100 0 32; 0 100 23"))
    found = match(folder / "left.png", folder / "right.png", calib=folder / "odd.txt", cache=folder / "cache")
    assert len(found.warnings) == 1
    assert "20" in found.warnings[0] and "23" in found.warnings[0]
    assert any("cy is 20" in note for note in found.result.plan.notes)
