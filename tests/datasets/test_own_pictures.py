"""Every row of the tables in ``docs/own-pictures.md`` that say what is read."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, TiffImagePlugin

from semidense.datasets import Calibration, DatasetError, ImageError, open_dataset, write_pfm
from semidense.datasets.formats.calibration.reading import read_cameras

PAGE = (Path(__file__).parents[2] / "docs" / "own-pictures.md").read_text()
P1 = "500 0 311 0 0 500 250 0 0 0 1 0"
P2 = "500 0 341 -60 0 500 250 0 0 0 1 0"
BESIDE = "500 0 311 25 0 500 250 0 0 0 1 0"
"""A left camera 50 mm left of the origin, whose partner is ``P2`` moved by as much."""
MOVED = "500 0 341 -35 0 500 250 0 0 0 1 0"
K = "500 0 311 0 500 250 0 0 1"


def rows(head: str) -> list[str]:
    """The first column of the table whose first head is this."""
    table = PAGE.split(f"| {head} |")[1].split("\n\n")[0].splitlines()
    return [line.split("|")[1].strip() for line in table[2:]]


def opencv(path: Path, **matrices: np.ndarray) -> list[Path]:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, matrix in matrices.items():
        storage.write(name, matrix)
    storage.release()
    return [path]


def text(path: Path, content: str) -> list[Path]:
    path.write_text(content)
    return [path]


def projections(folder: Path) -> list[Path]:
    left, right = (np.fromstring(each, sep=" ").reshape(3, 4) for each in (BESIDE, MOVED))
    return opencv(folder / "c.yml", P1=left, P2=right)


def reprojection(folder: Path) -> list[Path]:
    q = np.array([[1, 0, 0, -311], [0, 1, 0, -250], [0, 0, 0, 500], [0, 0, 1 / 0.12, 30 / 0.12]])
    return opencv(folder / "c.xml", Q=q)


def middlebury(folder: Path) -> list[Path]:
    cameras = "cam0=[500 0 311; 0 500 250; 0 0 1]\ncam1=[500 0 341; 0 500 250; 0 0 1]\n"
    return text(folder / "calib.txt", cameras + "doffs=30\nbaseline=120\nwidth=640\nheight=480\nndisp=70\n")


def ros(folder: Path) -> list[Path]:
    message = "height: 480\nwidth: 640\nP: [{}]\n---\n"
    sides = (("left", BESIDE), ("right", MOVED))
    return [text(folder / f"{side}.yaml", message.format(each.replace(" ", ", ")))[0] for side, each in sides]


def ini(folder: Path) -> list[Path]:
    camera = "[image]\nwidth\n640\nheight\n480\n[{}]\nprojection\n{}\n"
    return text(folder / "ost.txt", camera.format("left", BESIDE) + camera.format("right", MOVED))


def cityscapes(folder: Path) -> list[Path]:
    parts = {"intrinsic": {"fx": 500, "fy": 500, "u0": 311, "v0": 250}, "extrinsic": {"baseline": 0.12, "yaw": 0.1}}
    return text(folder / "camera.json", json.dumps(parts))


def karlsruhe(folder: Path) -> list[Path]:
    return text(folder / "c.txt", f"roi: 26 665 70 549\nP1: {P2}\nP1_roi: {P1}\nP2: {P1}\nP2_roi: {P2}\n")


def sensor(folder: Path) -> list[Path]:
    size = "camera.height=480\ncamera.width=640\n"
    return text(folder / "c.txt", f"camera.A=[500 0 311; 0 500 250; 0 0 1]\n{size}t=0.12\n")


def own_json(folder: Path) -> list[Path]:
    values = {"fx": 500, "fy": 500, "cx": 311, "cy": 250, "baseline": 120, "doffs": 30, "unit": "mm"}
    return text(folder / "c.json", json.dumps(values))


Made = tuple[Callable[[Path], list[Path]], str | None, float, tuple[int, int] | None]
CALIBRATIONS: dict[str, Made] = {
    "Middlebury, ETH3D": (middlebury, None, 30, (480, 640)),
    "OpenCV, projections": (projections, "m", 30, None),
    "OpenCV, reprojection": (reprojection, "m", 30, None),
    "ROS `CameraInfo`": (ros, None, 30, (480, 640)),
    "ROS `.ini`": (ini, None, 30, (480, 640)),
    "KITTI, benchmarks": (lambda folder: text(folder / "c.txt", f"P2: {BESIDE}\nP3: {MOVED}\n"), None, 30, None),
    "KITTI, raw data": (
        lambda folder: text(folder / "c.txt", f"S_rect_02: 640 480\nP_rect_02: {BESIDE}\nP_rect_03: {MOVED}\n"),
        None,
        30,
        (480, 640),
    ),
    "Karlsruhe": (karlsruhe, None, 30, (480, 640)),
    "`K.txt`": (lambda folder: text(folder / "K.txt", f"{K}\n0.12\n"), None, 0, None),
    "JSON, YAML, TOML": (own_json, None, 30, None),
    "Cityscapes": (cityscapes, "m", 0, None),
    "stereo sensor": (sensor, None, 0, (480, 640)),
}


def test_the_tables_have_no_other_rows() -> None:
    assert rows("calibration") == list(CALIBRATIONS)
    assert rows("pairs") == list(PAIRS)
    assert rows("pictures") == list(PICTURES)


@pytest.mark.parametrize("row", CALIBRATIONS)
def test_a_calibration(tmp_path: Path, row: str) -> None:
    """One pair of cameras in every format: f 500 px, 120 mm apart, the left principal point at (311, 250)."""
    make, unit, doffs, size = CALIBRATIONS[row]
    found = read_cameras(make(tmp_path), unit)
    known = found.calibration
    assert replace(known, baseline=120, doffs=doffs) == Calibration(500, 120, doffs, (311, 250))
    assert (known.baseline, known.doffs) == pytest.approx((120, doffs))
    assert (found.size, found.warnings) == (size, ())


@pytest.mark.parametrize("row", CALIBRATIONS)
def test_a_garbled_calibration_is_read_or_refused_in_one_line(tmp_path: Path, row: str) -> None:
    make, unit, *_ = CALIBRATIONS[row]
    files = make(tmp_path)
    whole, random = [file.read_bytes() for file in files], np.random.default_rng(1)
    for _ in range(60):
        for file, content in zip(files, whole, strict=True):
            place, length = int(random.integers(len(content))), int(random.integers(4))
            put = random.choice([b"nan", b"1e400", b"-", b"[", b"null", b"{", b"", b"\xff", b"true", b"\n"])
            file.write_bytes(content[:place] + bytes(put) + content[place + length :])
        try:
            read_cameras(files, unit)
        except DatasetError as refused:
            assert "\n" not in str(refused)


PAIRS = {
    "two files": (["x.png", "y.png"], "{0}/x.png,{0}/y.png"),
    "two folders": (["l/left1.png", "r/right1.png"], "{0}/l,{0}/r"),
    "one folder twice": (["l/1_L.png", "l/1_R.png"], "{0}/l,{0}/l"),
    "two patterns": (["x-7.png", "y+7.png"], "{0}/x-*.png,{0}/y+*.png"),
    "a list": (["x.png", "y.png"], "{0}/pairs.csv"),
    "`--split side-by-side`": (["x.png"], "{0}/x.png,split=side-by-side"),
    "`--split over-under`": (["x.png"], "{0}/x.png,split=over-under"),
}


@pytest.mark.parametrize("row", PAIRS)
def test_a_pair(tmp_path: Path, row: str) -> None:
    names, spec = PAIRS[row]
    for value, name in enumerate(names):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        view = np.full((4, 6), 10 * value, np.uint8)
        if len(names) == 1:
            view[2:, :] += 1
            view[:, 3:] += 2
        Image.fromarray(view).save(tmp_path / name)
    (tmp_path / "pairs.csv").write_text("Left;Right\nx.png;y.png\n")
    (scene,) = open_dataset("pair:" + spec.format(tmp_path)).scenes
    left, right = scene.load_images()
    halves = {"`--split side-by-side`": 2, "`--split over-under`": 1}
    assert (left[0, 0], right[0, 0]) == (0, halves.get(row, 10))


def depths(left: np.ndarray, right: np.ndarray) -> Callable[[Path], tuple[Path, Path]]:
    def save(folder: Path) -> tuple[Path, Path]:
        for name, view in (("l.tif", left), ("r.tif", right)):
            Image.fromarray(view).save(folder / name)
        return folder / "l.tif", folder / "r.tif"

    return save


def previews(folder: Path) -> tuple[Path, Path]:
    picture, preview = (Image.new("L", size, 77) for size in ((6, 4), (3, 2)))
    for name in ("l.jpg", "r.jpg"):
        picture.save(folder / name, "MPO", save_all=True, append_images=[preview])
    return folder / "l.jpg", folder / "r.jpg"


def formats(folder: Path) -> tuple[Path, Path]:
    Image.new("RGBA", (6, 4), (77, 77, 77, 5)).save(folder / "l.png")
    Image.new("L", (6, 4), 77).convert("P").save(folder / "r.bmp")
    return folder / "l.png", folder / "r.bmp"


def with_preview(folder: Path) -> tuple[Path, Path]:
    for name in ("l.tif", "r.tif"):
        with TiffImagePlugin.AppendingTiffWriter(str(folder / name), True) as file:
            for kind, size in ((1, (3, 2)), (0, (6, 4))):
                Image.new("L", size, 77).save(file, "TIFF", tiffinfo={254: kind})
                file.newFrame()
    return folder / "l.tif", folder / "r.tif"


def gray_maps(folder: Path) -> tuple[Path, Path]:
    for name in ("l.pgm", "r.pgm"):
        (folder / name).write_bytes(b"P5\n6 4\n1023\n" + np.full((4, 6), 1023, ">u2").tobytes())
    return folder / "l.pgm", folder / "r.pgm"


GRAY = np.full((4, 6), 77)
PICTURES = {
    "PNG, JPEG, TIFF, BMP, PPM": (formats, 77),
    "TIFF with previews or masks": (with_preview, 77),
    "PGM with another largest value": (gray_maps, 65535),
    "JPEG with a preview (MPO)": (previews, 77),
    "16-bit gray": (depths((GRAY * 0 + 4095).astype(np.uint16), GRAY.astype(np.uint16)), 65535),
    "32-bit whole numbers": (depths((GRAY * 0 + 4095).astype(np.int32), GRAY.astype(np.int32)), 65535),
    "views that differ": (depths(GRAY.astype(np.uint8), (GRAY * 257).astype(np.uint16)), 77 * 257),
}


@pytest.mark.parametrize("row", PICTURES)
def test_a_picture(tmp_path: Path, row: str) -> None:
    make, value = PICTURES[row]
    left, right = make(tmp_path)
    (scene,) = open_dataset(f"pair:{left},{right}").scenes
    views = scene.load_images()
    assert views[0].dtype == views[1].dtype
    assert np.abs(views[0].astype(int) - value).max() <= 1
    assert views[1].shape == views[0].shape


@pytest.mark.parametrize("mode", ["F", "CMYK"])
def test_what_is_refused(tmp_path: Path, mode: str) -> None:
    Image.new(mode, (6, 4)).save(tmp_path / "x.tif")
    with pytest.raises(ImageError, match=mode):
        open_dataset(f"pair:{tmp_path}/x.tif,{tmp_path}/x.tif").scenes[0].load_images()


def test_the_description_on_the_page_is_read(tmp_path: Path, save_image: Callable[..., Path]) -> None:
    (described,) = re.findall(r"```\n(left = .*?)```", PAGE, re.DOTALL)
    for side in ("left", "right"):
        save_image(tmp_path / side / "a.png", np.zeros((480, 640), np.uint8))
    (tmp_path / "disparity").mkdir()
    write_pfm(tmp_path / "disparity/a.pfm", np.full((480, 640), 7, np.float32))
    save_image(tmp_path / "visible/a.png", np.full((480, 640), 255, np.uint8))
    middlebury(tmp_path)
    (tmp_path / "own.toml").write_text(described)
    (scene,) = open_dataset(f"toml:{tmp_path}/own.toml").scenes
    assert (scene.name, scene.split, scene.has_truth) == ("a", "test", True)
    assert (scene.disparities.minimum, scene.disparities.maximum) == (0, 191)
    assert scene.calibration is not None
