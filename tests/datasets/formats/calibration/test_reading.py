"""Calibrations as OpenCV and ROS write them, one known camera: f 500 px, baseline 120 mm, centres 311 and 341."""

from pathlib import Path

import numpy as np
import pytest

from semidense.datasets import Calibration, CalibrationError, MissingFileError
from semidense.datasets.formats.calibration.reading import read_cameras

EXPECTED = Calibration(500, 120, 30, (311, 250))
P1 = np.array([[500.0, 0, 311, 0], [0, 500, 250, 0], [0, 0, 1, 0]])
P2 = np.array([[500.0, 0, 341, -500 * 0.12], [0, 500, 250, 0], [0, 0, 1, 0]])
Q = np.array([[1.0, 0, 0, -311], [0, 1, 0, -250], [0, 0, 0, 500], [0, 0, 1 / 0.12, 30 / 0.12]])
ROS = "image_width: 640\nimage_height: 480\ncamera_name: c\nprojection_matrix:\n  rows: 3\n  cols: 4\n  data: {}\n"


def opencv(path: Path, **matrices: np.ndarray) -> Path:
    import cv2

    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, matrix in matrices.items():
        storage.write(name, matrix)
    storage.release()
    return path


@pytest.mark.parametrize("ending", ["yml", "xml"])
@pytest.mark.parametrize("matrices", [{"P1": P1, "P2": P2}, {"Q": Q}], ids=["projections", "Q"])
def test_what_opencv_writes_is_read(tmp_path: Path, ending: str, matrices: dict[str, np.ndarray]) -> None:
    found = read_cameras([opencv(tmp_path / f"c.{ending}", R=np.eye(3), **matrices)], "m")
    known = found.calibration
    assert (known.focal, known.centre) == (500, (311, 250))
    assert np.allclose([known.baseline, known.doffs], [120, 30], rtol=1e-9)
    assert (found.size, found.ndisp) == (None, None)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_byte_order_mark_does_not_matter(tmp_path: Path, encoding: str) -> None:
    path = opencv(tmp_path / "c.yml", P1=P1, P2=P2)
    path.write_text(path.read_text(), encoding=encoding)
    assert read_cameras([path], "m").calibration == EXPECTED


@pytest.mark.parametrize(
    ("ending", "mark", "size"),
    [
        pytest.param("yml", "---\n", "image_width: 640\nimage_height: 480\n", id="two lines"),
        pytest.param("yml", "---\n", "imageSize: [ 640, 480 ]\n", id="a cv::Size"),
        pytest.param(
            "xml", "<opencv_storage>\n", "<image_width>640</image_width><image_height>480</image_height>", id="XML"
        ),
        pytest.param("xml", "<opencv_storage>\n", "<imageSize>\n  640 480</imageSize>", id="a cv::Size in XML"),
    ],
)
def test_the_size_in_an_opencv_file_is_read(tmp_path: Path, ending: str, mark: str, size: str) -> None:
    path = opencv(tmp_path / f"c.{ending}", P1=P1, P2=P2)
    assert mark in path.read_text()
    path.write_text(path.read_text().replace(mark, mark + size, 1))
    assert read_cameras([path], "m").size == (480, 640)


def test_q_is_the_same_as_what_opencv_reprojects_with(tmp_path: Path) -> None:
    import cv2

    known = read_cameras([opencv(tmp_path / "c.yml", Q=Q)], "m").calibration
    z = cv2.reprojectImageTo3D(np.full((1, 1), 20, np.float32), Q.astype(np.float32))[0, 0, 2]
    assert np.isclose(z * 1000, known.baseline * known.focal / (20 + known.doffs), rtol=1e-5)


def ros(folder: Path, left: np.ndarray = P1, right: np.ndarray = P2, text: str = ROS) -> list[Path]:
    files = [folder / "left.yaml", folder / "right.yaml"]
    for file, matrix in zip(files, (left, right), strict=True):
        file.write_text(text.format(matrix.ravel().tolist()))
    return files


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(ROS, id="camera_calibration"),
        pytest.param("height: 480\nwidth: 640\nP: {}\n", id="a message"),
    ],
)
def test_a_ros_pair_is_read_in_metres(tmp_path: Path, text: str) -> None:
    found = read_cameras(ros(tmp_path, text=text))
    assert found.calibration == EXPECTED
    assert found.size == (480, 640)


def changed(matrix: np.ndarray, row: int, column: int, value: float) -> np.ndarray:
    copy = matrix.copy()
    copy[row, column] = value
    return copy


@pytest.mark.parametrize(
    ("left", "right", "message"),
    [
        pytest.param(P2, P1, "exchange the two views", id="exchanged"),
        pytest.param(P1, changed(changed(P2, 0, 3, 0), 1, 3, -60), "one above the other", id="vertical"),
        pytest.param(P1, changed(P2, 0, 0, 600), "focal lengths 500 and 600", id="two focal lengths"),
        pytest.param(P1[:2], P2, "no matrix of 3 x 4", id="a row is missing"),
        pytest.param(changed(P1, 0, 2, np.nan), P2, "no matrix", id="not a number"),
    ],
)
def test_cameras_that_are_no_rectified_pair_are_refused(
    tmp_path: Path, left: np.ndarray, right: np.ndarray, message: str
) -> None:
    with pytest.raises(CalibrationError, match=message):
        read_cameras(ros(tmp_path, left, right))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        pytest.param(b"", "no known calibration format.*Middlebury.*OpenCV.*ROS.*KITTI.*K.txt.*JSON", id="empty"),
        pytest.param(b"%YAML:1.0\n---\nK: 3\n", "neither P1 and P2 nor Q", id="another calibration"),
        pytest.param(b"%YAML:1.0\n---\nP1: [1, 2]\nP2: [1]\n", "P1 is no matrix", id="too small"),
        pytest.param(b"%YAML:1.0\n---\n- 1\n", "no names and values", id="a sequence"),
        pytest.param(b"%YAML:1.0\n---\nP1: [\n", "no valid YAML", id="truncated YAML"),
        pytest.param(b"%YAML:1.0\nP1: !!python/object/apply:os.getcwd []\n", "no valid YAML", id="a payload"),
        pytest.param(b"<?xml version='1.0'?><opencv_storage><Q>", "damaged XML", id="truncated XML"),
        pytest.param(b"<?xml version='1.0'?><opencv_storage/>", "neither P1", id="empty XML"),
        pytest.param(b"\x89PNG\xff\xfe", "not plain text", id="a picture"),
        pytest.param(b"#" * (1 << 19), "no calibration", id="too large"),
    ],
)
def test_a_bad_file_is_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "c.yml"
    path.write_bytes(content)
    with pytest.raises(CalibrationError, match=message) as refused:
        read_cameras([path], "m")
    assert "\n" not in str(refused.value)


def test_the_two_files_of_opencvs_sample(tmp_path: Path) -> None:
    files = [opencv(tmp_path / "intrinsics.yml", M1=P1[:, :3], M2=P2[:, :3]), tmp_path / "extrinsics.yml"]
    opencv(files[1], R=np.eye(3), T=np.array([[-0.12], [0], [0]]), P1=P1, P2=P2, Q=Q)
    assert read_cameras(files, "m").calibration == EXPECTED


def test_two_files_of_another_kind_are_refused(tmp_path: Path) -> None:
    (tmp_path / "c.txt").write_text("cam0=[500 0 311; 0 500 250; 0 0 1]\n")
    with pytest.raises(CalibrationError, match="of calibrations in two files, ROS's and OpenCV's are read"):
        read_cameras([tmp_path / "c.txt"] * 2)


def test_a_comment_may_stand_above_opencvs_directive(tmp_path: Path) -> None:
    path = opencv(tmp_path / "c.yml", P1=P1, P2=P2)
    path.write_text("# the rig on the roof\n" + path.read_text())
    assert read_cameras([path], "m").calibration == EXPECTED


def test_opencv_needs_a_unit(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="does not tell its unit"):
        read_cameras([opencv(tmp_path / "c.yml", Q=Q)])


@pytest.mark.parametrize(
    ("files", "unit", "error"),
    [
        pytest.param([Path("/none/c.yml")], None, MissingFileError, id="missing"),
        pytest.param([Path("a"), Path("b"), Path("c")], None, CalibrationError, id="three"),
        pytest.param([Path("a")], "inch", CalibrationError, id="another unit"),
    ],
)
def test_a_wrong_request_is_refused(files: list[Path], unit: str | None, error: type[Exception]) -> None:
    with pytest.raises(error):
        read_cameras(files, unit)
