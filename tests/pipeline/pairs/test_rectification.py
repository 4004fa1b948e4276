"""A rectified pair whose cameras were turned on the spot is level again; matches of points judge it."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from semidense.datasets import open_dataset, read_image
from semidense.datasets.errors import CalibrationError
from semidense.datasets.formats.calibration.reading import read_cameras
from semidense.pipeline.cli.commands.rectify import rectify
from semidense.pipeline.pairs.rectification import rectify_files
from semidense.pipeline.plan.errors import UsageError

PAGE = Path(__file__).parents[3] / "docs" / "own-pictures.md"
FOCAL, SCALE = 999.421, 2
"""Focal length of the Motorcycle pair in px, and how often its size is halved here."""
TURNED = (np.array([0.01, -0.02, 0.015]), np.array([-0.012, 0.018, -0.01]))
"""Rotation vectors of the two cameras, rad: some 20 px at their focal length."""
BASELINE = 193.001


def plain(size: tuple[int, int]) -> np.ndarray:
    return np.array([[FOCAL / SCALE, 0, size[1] / 2], [0, FOCAL / SCALE, size[0] / 2], [0, 0, 1]])


def turned(view: np.ndarray, camera: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return what a camera sees that is turned on the spot: an homography, K R K^-1."""
    rows, columns = view.shape[:2]
    homography = camera @ rotation @ np.linalg.inv(camera)
    return cv2.warpPerspective(view, homography, (columns, rows), flags=cv2.INTER_CUBIC)


@pytest.fixture(scope="module")
def taken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Motorcycle pair as two turned cameras would take it, and what cv2.stereoCalibrate would say of them."""
    folder = tmp_path_factory.mktemp("taken")
    views = [view[::SCALE, ::SCALE] for view in open_dataset("motorcycle").scenes[0].load_images()]
    camera = plain(views[0].shape[:2])
    rotations = [cv2.Rodrigues(each)[0] for each in TURNED]
    for name, view, rotation in zip(("left", "right"), views, rotations, strict=True):
        Image.fromarray(turned(view, camera, rotation)).save(folder / f"{name}.png")
        Image.fromarray(view).save(folder / f"level-{name}.png")
    write(folder / "stereo.yml", values(camera, rotations))
    return folder


def values(camera: np.ndarray, rotations: list[np.ndarray]) -> dict[str, np.ndarray]:
    """Return X_right = R X_left + T of cameras that stand level, BASELINE apart, and are turned on the spot."""
    first, second = rotations
    place = second @ np.array([[-BASELINE], [0], [0]])
    none = np.zeros((1, 5))
    return {"M1": camera, "D1": none, "M2": camera, "D2": none, "R": second @ first.T, "T": place}


def write(path: Path, matrices: dict[str, np.ndarray]) -> None:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, matrix in matrices.items():
        storage.write(name, matrix)
    storage.release()


def offsets(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return how far below the left view's point the right one's lies, px, of distinctive matches."""
    found = cv2.SIFT_create(2000)
    (points, first), (others, second) = (
        found.detectAndCompute(cv2.cvtColor(each, cv2.COLOR_RGB2GRAY), None) for each in (left, right)
    )
    pairs = [a for a, b in cv2.BFMatcher().knnMatch(first, second, k=2) if a.distance < 0.6 * b.distance]
    return np.array([others[each.trainIdx].pt[1] - points[each.queryIdx].pt[1] for each in pairs])


def test_a_real_pair_of_turned_cameras_is_level_again(taken: Path, tmp_path: Path) -> None:
    rectify_files(taken / "left.png", taken / "right.png", [taken / "stereo.yml"], tmp_path / "out", "mm")
    before = offsets(read_image(taken / "left.png"), read_image(taken / "right.png"))
    after = offsets(read_image(tmp_path / "out" / "left.png"), read_image(tmp_path / "out" / "right.png"))
    assert np.median(np.abs(before)) > 5
    assert len(after) > 100
    assert np.median(np.abs(after)) < 0.3
    assert np.mean(np.abs(after) < 1) > 0.9


def test_the_pages_script_levels_two_photos_without_a_calibration(
    taken: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Judged by matches of its own: level rows, and disparities that begin near 0."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (script,) = (block for block in blocks if "stereoRectifyUncalibrated" in block)
    monkeypatch.chdir(tmp_path)
    for side in ("left", "right"):
        Image.open(taken / f"{side}.png").save(f"{side}.jpg", quality=98)
    exec(script, {})
    rows = offsets(read_image(tmp_path / "left.png"), read_image(tmp_path / "right.png"))
    assert np.abs(np.median(rows)) < 0.5
    assert np.percentile(np.abs(rows), 75) < 1


def test_what_is_written_is_read_by_match(taken: Path, tmp_path: Path) -> None:
    files = rectify_files(taken / "left.png", taken / "right.png", [taken / "stereo.yml"], tmp_path / "out", "mm")
    known = read_cameras([files[2]]).calibration
    assert known.baseline == pytest.approx(BASELINE, rel=1e-6), "turning a camera on the spot moves it nowhere"


def test_projections_of_an_earlier_rectification_are_taken(taken: Path, tmp_path: Path) -> None:
    """R1, R2, P1 and P2 that undo the turns exactly give the level views back, but for resampling and the edges."""
    level = [read_image(taken / f"level-{side}.png") for side in ("left", "right")]
    camera = plain(level[0].shape[:2])
    first, second = (cv2.Rodrigues(each)[0] for each in TURNED)
    none = np.zeros((1, 5))
    write(tmp_path / "intrinsics.yml", {"M1": camera, "D1": none, "M2": camera, "D2": none})
    moved = np.column_stack([camera, [-FOCAL / SCALE * BASELINE, 0, 0]])
    left = np.column_stack([camera, np.zeros(3)])
    write(tmp_path / "extrinsics.yml", {"R1": first.T, "R2": second.T, "P1": left, "P2": moved})
    calibration = [tmp_path / "intrinsics.yml", tmp_path / "extrinsics.yml"]
    rectify_files(taken / "left.png", taken / "right.png", calibration, tmp_path / "out")
    for side, expected in zip(("left", "right"), level, strict=True):
        inner = np.s_[40:-40, 40:-40]
        found = read_image(tmp_path / "out" / f"{side}.png")[inner].astype(int)
        assert np.median(np.abs(found - expected[inner])) <= 3


@pytest.mark.parametrize(("depth", "shape"), [(np.uint8, (30, 40)), (np.uint8, (30, 40, 3)), (np.uint16, (30, 40))])
def test_an_identity_keeps_every_value(tmp_path: Path, depth: type, shape: tuple[int, ...]) -> None:
    camera = np.array([[50.0, 0, 20], [0, 50, 15], [0, 0, 1]])
    right = np.column_stack([camera, [-50.0, 0, 0]])
    same = {"M1": camera, "M2": camera, "R1": np.eye(3), "R2": np.eye(3), "P2": right}
    write(tmp_path / "c.xml", same | {"P1": np.column_stack([camera, np.zeros(3)])})
    view = np.random.default_rng(0).integers(0, np.iinfo(depth).max, shape, depth)
    for name in ("a.png", "b.png"):
        cv2.imwrite(str(tmp_path / name), view)
    rectify_files(tmp_path / "a.png", tmp_path / "b.png", [tmp_path / "c.xml"], tmp_path / "out")
    assert np.array_equal(cv2.imread(str(tmp_path / "out" / "left.png"), cv2.IMREAD_UNCHANGED), view)


@pytest.mark.parametrize(
    ("missing", "words"),
    [("M1", "no M1"), ("R", "neither R and T nor"), ("T", "neither R and T nor")],
)
def test_a_missing_matrix_is_named(taken: Path, tmp_path: Path, missing: str, words: str) -> None:
    rows, columns = read_image(taken / "left.png").shape[:2]
    given = values(plain((rows, columns)), [np.eye(3), np.eye(3)])
    path = tmp_path / "c.json"
    path.write_text(json.dumps({name: value.tolist() for name, value in given.items() if name != missing}))
    with pytest.raises(CalibrationError, match=words):
        rectify_files(taken / "left.png", taken / "right.png", [path], tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("size", "words"),
    [
        ({"image_width": 640, "image_height": 480}, "480 x 640 pixels"),
        ({"imageSize": [640, 480]}, "480 x 640 pixels"),
        ({"resolution": {"width": 640, "height": 480}}, "480 x 640 pixels"),
        ({"image_shape": [480, 640]}, "480 x 640 pixels"),
        ({"image_width": 640}, r"\? x 640 pixels"),
        ({"height": 480}, r"480 x \? pixels"),
    ],
)
def test_a_calibration_of_another_size_is_refused(
    taken: Path, tmp_path: Path, size: dict[str, object], words: str
) -> None:
    given = values(plain((480, 640)), [np.eye(3), np.eye(3)])
    told = {name: value.tolist() for name, value in given.items()} | size
    (tmp_path / "c.json").write_text(json.dumps(told))
    with pytest.raises(CalibrationError, match=words):
        rectify_files(taken / "left.png", taken / "right.png", [tmp_path / "c.json"], tmp_path / "out")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"T": [[0], [0], [0]]}, "T is 0"),
        ({"T": [[0], [-1], [0]]}, "one above the other"),
        ({"T": [[1], [0], [0]]}, "right camera"),
        ({"R": np.zeros((3, 3)).tolist()}, "R is no rotation"),
        ({"R": np.diag([1, 1, -1]).tolist()}, "R is no rotation"),
        ({"M1": np.zeros((3, 3)).tolist()}, "M1 is no camera matrix"),
        ({"D1": [[0, 0], [0]]}, "D1 is no list of 4, 5, 8, 12 or 14 numbers"),
        ({"D2": ["a", "b", "c", "d"]}, "D2 is no list of 4, 5, 8, 12 or 14 numbers"),
        ({"image_width": "wide", "image_height": 3}, "the image's size is no matrix of 1 x 2 numbers"),
        ({"m1": np.eye(3).tolist()}, "m1 is given twice, with different values"),
    ],
)
def test_cameras_that_cannot_be_are_refused_before_anything_is_written(
    taken: Path, tmp_path: Path, given: dict[str, object], words: str
) -> None:
    camera = plain(read_image(taken / "left.png").shape[:2])
    told = {name: value.tolist() for name, value in values(camera, [np.eye(3), np.eye(3)]).items()}
    (tmp_path / "c.json").write_text(json.dumps(told | given))
    with pytest.raises(CalibrationError, match=words):
        rectify_files(taken / "left.png", taken / "right.png", [tmp_path / "c.json"], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_two_files_that_contradict_each_other_are_refused(taken: Path, tmp_path: Path) -> None:
    (tmp_path / "t.json").write_text(json.dumps({"T": [[-5], [0], [0]]}))
    files = [taken / "stereo.yml", tmp_path / "t.json"]
    with pytest.raises(CalibrationError, match=r"stereo\.yml and .*t\.json: T is given twice, with different values"):
        rectify_files(taken / "left.png", taken / "right.png", files, tmp_path / "out")


def test_projections_that_no_camera_has_are_refused(taken: Path, tmp_path: Path) -> None:
    camera = plain(read_image(taken / "left.png").shape[:2])
    none = np.zeros((3, 4))
    write(tmp_path / "c.yml", {"M1": camera, "M2": camera, "R1": np.eye(3), "R2": np.eye(3), "P1": none, "P2": none})
    with pytest.raises(CalibrationError, match=r"c\.yml"):
        rectify_files(taken / "left.png", taken / "right.png", [tmp_path / "c.yml"], tmp_path / "out")


def test_a_size_may_be_stored_as_a_float(taken: Path, tmp_path: Path) -> None:
    rows, columns = read_image(taken / "left.png").shape[:2]
    told = {name: value.tolist() for name, value in values(plain((rows, columns)), [np.eye(3), np.eye(3)]).items()}
    (tmp_path / "c.json").write_text(json.dumps(told | {"image_width": float(columns), "image_height": float(rows)}))
    assert rectify_files(taken / "left.png", taken / "right.png", [tmp_path / "c.json"], tmp_path / "out")


def test_a_unit_that_match_would_refuse_is_refused(taken: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="unit 'parsec'"):
        rectify_files(taken / "left.png", taken / "right.png", [taken / "stereo.yml"], tmp_path / "out", "parsec")


def test_the_next_command_asks_for_a_unit_that_was_not_given(
    taken: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    views = taken / "left.png", taken / "right.png"
    rectify(*views, [taken / "stereo.yml"], tmp_path / "a")
    assert "--unit UNIT -o DIR" in capsys.readouterr().out
    rectify(*views, [taken / "stereo.yml"], tmp_path / "b", unit="mm")
    assert "--unit" not in capsys.readouterr().out


def test_the_views_are_not_overwritten(taken: Path) -> None:
    with pytest.raises(UsageError, match="reads this file"):
        rectify_files(taken / "left.png", taken / "right.png", [taken / "stereo.yml"], taken)
