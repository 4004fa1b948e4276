"""The command ``match``: what it prints and writes, and what it refuses in one line with nothing left behind."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from skimage.data import stereo_motorcycle

Invoke = Callable[..., Any]


@pytest.fixture
def pair(make_pair: Callable[[Path], Path], tmp_path: Path) -> Path:
    """40 x 48 px, 2 px apart."""
    return make_pair(tmp_path / "pair")


def test_one_command_from_two_files_to_a_folder(invoke: Invoke, pair: Path, tmp_path: Path) -> None:
    arguments = ["match", pair / "im0.png", pair / "im1.png", "--calib", pair / "calib.txt", "--density", "50%"]
    ran = invoke(*arguments, "-o", tmp_path / "out", "--format", "pfm,png", "--cache", tmp_path / "cache")
    assert ran.code == 0, ran.err
    assert "disparities 0 to 3 px" in ran.out
    assert "from the pair's own confidences" in ran.out
    assert {"disparity.pfm", "points.ply", "summary.json"} <= {path.name for path in (tmp_path / "out").iterdir()}
    again = invoke(*arguments, "-o", tmp_path / "out", "--cache", tmp_path / "cache", "--json")
    (about,) = json.loads(again.out)["pairs"]
    assert set(about["reused"]) >= {"images", "costvolume", "confidence"}
    assert 50 <= about["density_percent"] <= 100


def test_a_right_view_that_lies_lower_is_matched_all_the_same(invoke: Invoke, tmp_path: Path) -> None:
    """Motorcycle at half size, its right view 5 px lower: of the rows as they are, three quarters come out wrong."""
    left, right, truth = stereo_motorcycle()
    views = [np.asarray(Image.fromarray(view).resize((370, 250))) for view in (left, right)]
    for name, view in zip(("left.png", "right.png"), (views[0], np.roll(views[1], 5, axis=0)), strict=True):
        save(tmp_path / name, view)
    arguments = ["match", tmp_path / "left.png", tmp_path / "right.png", "--min-disp", "0", "--max-disp", "40"]
    ran = invoke(*arguments, "-o", tmp_path / "out", "--format", "npy", "--cache", tmp_path / "cache")
    assert ran.code == 0, ran.err
    assert "its rows were shifted, so the map can be right, but its depth may be wrong" in ran.err
    assert "shifted the rows of the right view by +4.9 to +5.0 px" in ran.out
    low, high = json.loads((tmp_path / "out" / "summary.json").read_text())["rows_shifted_px"]
    assert 4.8 < low < high < 5.2
    wrong = np.abs(np.load(tmp_path / "out" / "disparity_raw.npy") - truth[::2, ::2][:250, :370] / 2) > 1
    known = np.isfinite(truth[::2, ::2][:250, :370])
    assert wrong[known].mean() < 0.2


@pytest.mark.parametrize(("variable", "drawn"), [("COLORTERM", True), ("NO_COLOR", False)])
def test_a_terminal_in_colour_shows_the_map(
    invoke: Invoke, pair: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variable: str, drawn: bool
) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    for name, value in (("FORCE_COLOR", "1"), ("TERM", "xterm-256color"), (variable, "truecolor")):
        monkeypatch.setenv(name, value)
    files = pair / "im0.png", pair / "im1.png"
    ran = invoke("match", *files, "--max-disp", "3", "-o", tmp_path / "out", "--cache", tmp_path / "cache")
    assert ran.code == 0, ran.err
    assert ("▀" in ran.out) == drawn
    assert ("black none" in ran.out) == drawn


def test_a_dry_run_says_what_would_be_made_and_makes_nothing(invoke: Invoke, pair: Path, tmp_path: Path) -> None:
    files = pair / "im0.png", pair / "im1.png"
    ran = invoke(
        "match", *files, "--max-disp", "4", "--min-disp", "0", "--fill", "--dry-run", "--cache", tmp_path / "c"
    )
    assert ran.code == 0, ran.err
    assert "1 filled" in ran.out
    assert not (tmp_path / "c").exists()
    assert not Path("matched").exists()


def save(path: Path, array: np.ndarray) -> None:
    Image.fromarray(array).save(path)


def truncate(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2)


PAGE = Image.new("L", (48, 40))
GRAY = np.zeros((40, 48), np.uint8)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        pytest.param(lambda right: right.unlink(), ["im1.png", "no such file"], id="missing"),
        pytest.param(lambda right: right.write_bytes(b""), ["im1.png"], id="empty"),
        pytest.param(lambda right: right.write_bytes(b"GIF89a" + bytes(99)), ["im1.png", "PNG"], id="another kind"),
        pytest.param(lambda right: right.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(9)), ["im1.png"], id="magic alone"),
        pytest.param(truncate, ["im1.png"], id="truncated"),
        pytest.param(lambda right: save(right, GRAY[:, :47]), ["40 x 47", "40 x 48"], id="sizes that differ"),
        pytest.param(lambda right: save(right, GRAY[:1, :1]), ["1 x 1"], id="one pixel"),
        pytest.param(lambda right: Image.new("F", (48, 40)).save(right, "TIFF"), ["im1.png", "F"], id="floats"),
        pytest.param(lambda right: Image.new("CMYK", (48, 40)).save(right, "JPEG"), ["im1.png", "CMYK"], id="CMYK"),
        pytest.param(lambda right: Image.new("1", (20000, 20000)).save(right, "PNG"),
                     ["too many pixels"], id="a bomb"),
        pytest.param(lambda right: PAGE.save(right, "TIFF", save_all=True, append_images=[PAGE]), ["holds 2 images"],
                     id="many in one"),
    ],
)  # fmt: skip
def test_a_bad_picture_is_one_line_and_leaves_nothing(
    invoke: Invoke, pair: Path, tmp_path: Path, damage: Callable[[Path], object], words: list[str]
) -> None:
    damage(pair / "im1.png")
    refused(invoke, tmp_path, [pair / "im0.png", pair / "im1.png"], words)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        pytest.param(["{}/im0.png"], ["the right view is missing"], id="one picture"),
        pytest.param(["{}", "{}/im1.png"], ["one is a folder"], id="a folder and a picture"),
        pytest.param(["{}/im0.png", "{}/im1.png", "--max-disp", "48"], ["only 48 px wide"], id="wider than the image"),
        pytest.param(["{}/im0.png", "{}/im1.png", "--min-disp", "9", "--max-disp", "3"], ["is empty"], id="empty"),
        pytest.param(["{}/im0.png", "{}/im1.png", "--R", "2"], ["semidense.R = 2"], id="R above 1"),
        pytest.param(["{}/im0.png", "{}/im1.png", "--density", "much"], ["such as 80%"], id="no share"),
        pytest.param(["{}/im0.png", "{}/im1.png", "--density", "120%"], ["such as 80%"], id="more than all"),
        pytest.param(["{}/im0.png", "{}/im1.png", "--R", "0.5", "--density", "50%"], ["one of them"], id="both"),
        pytest.param(["{}/im0.png", "{}/im1.png", "--max-error", "2", "--R", "1"], ["such as 2%"], id="200 % error"),
        pytest.param(["{}/im0.png", "{}/im1.png", "--format", "jpeg"], ["no format 'jpeg'"], id="no such format"),
        pytest.param(["{}/im0.png", "{}/im1.png", "--calib", "{}/im0.png"], ["not plain text"], id="picture as calib"),
        pytest.param(["{}/im0.png", "{}/im1.png", "--calib", "{}/none"], ["none"], id="no calibration there"),
        pytest.param(["{}/im0.png", "{}/im1.png", "--calib", "{}/calib.txt", "--unit", "ft"], ["mm, cm, m"], id="unit"),
    ],
)  # fmt: skip
def test_a_wrong_request_is_one_line_and_leaves_nothing(
    invoke: Invoke, pair: Path, tmp_path: Path, given: list[str], words: list[str]
) -> None:
    refused(invoke, tmp_path, [text.format(pair) for text in given], words)


def refused(invoke: Invoke, tmp_path: Path, arguments: list[Any], words: list[str]) -> None:
    """Check that a command says one line, exits with 2, and writes no result and no product."""
    ran = invoke("match", *arguments, "-o", tmp_path / "out", "--cache", tmp_path / "cache")
    assert (ran.code, ran.out) == (2, ""), ran
    assert ran.err.startswith("pipeline: ")
    assert ran.err.count("\n") == 1, ran.err
    assert [word for word in words if word not in ran.err] == []
    assert not (tmp_path / "out").exists()
    assert not list((tmp_path / "cache").glob("records/*/*"))
    assert not list((tmp_path / "cache").glob("drafts/*"))


def test_outputs_that_would_overwrite_the_inputs_are_refused(invoke: Invoke, pair: Path, tmp_path: Path) -> None:
    before = {}
    for old, new in (("im0.png", "disparity.png"), ("im1.png", "confidence.png")):
        (pair / old).rename(pair / new)
        before[new] = (pair / new).read_bytes()
    views = pair / "disparity.png", pair / "confidence.png"
    ran = invoke("match", *views, "--max-disp", "3", "-o", pair, "--cache", tmp_path / "cache")
    assert (ran.code, ran.out) == (2, "")
    assert "confidence.png: the command reads this file and would overwrite it" in ran.err
    assert {name: (pair / name).read_bytes() for name in before} == before
    assert not (tmp_path / "cache").exists()


def test_a_file_that_no_match_wrote_is_kept(invoke: Invoke, pair: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "disparity.pfm").write_text("mine")
    command = ["match", pair / "im0.png", pair / "im1.png", "--max-disp", "3", "-o", tmp_path / "out"]
    ran = invoke(*command, "--cache", tmp_path / "cache")
    assert (ran.code, ran.out) == (2, "")
    assert "disparity.pfm: this file was not written by an earlier command" in ran.err
    assert (tmp_path / "out" / "disparity.pfm").read_text() == "mine"


def test_a_place_that_cannot_be_written_is_told_before_anything_is_made(
    invoke: Invoke, pair: Path, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("mine")
    for place in (tmp_path / "file", tmp_path / "file" / "below"):
        ran = invoke("match", pair / "im0.png", pair / "im1.png", "-o", place, "--cache", tmp_path / "cache")
        assert (ran.code, ran.out) == (2, "")
        assert ran.err == f"pipeline: {place}: cannot be written ({tmp_path / 'file'} is a file); name another place\n"
    assert not (tmp_path / "cache").exists()


def oriented(view: Image.Image) -> Image.Image:
    """Turn a view on its side; the orientation tag turns it back."""
    return view.transpose(Image.Transpose.ROTATE_90)


def with_tag() -> Image.Exif:
    exif = Image.Exif()
    exif[0x0112] = 6
    return exif


@pytest.mark.parametrize(
    ("name", "store"),
    [
        pytest.param("a.png", lambda view, path: view.convert("L").save(path), id="gray"),
        pytest.param("a.png", lambda view, path: view.convert("RGBA").save(path), id="alpha"),
        pytest.param("a.png", lambda view, path: view.quantize(200).save(path), id="palette"),
        pytest.param("a.tif", lambda view, path: view.save(path), id="TIFF"),
        pytest.param("a.jpg", lambda view, path: oriented(view).save(path, exif=with_tag()), id="JPEG on its side"),
        pytest.param("a.png", lambda view, path: save(path, np.asarray(view.convert("L")).astype(np.uint16) * 257),
                     id="16 bits beside 8 bits of colour"),
    ],
)  # fmt: skip
def test_pictures_of_every_kind_are_taken_beside_plain_ones(
    pair: Path, name: str, store: Callable[[Image.Image, Path], None]
) -> None:
    from semidense.datasets import open_dataset
    from semidense.stages.transforms.gray import to_gray

    store(Image.open(pair / "im0.png"), pair / name)
    (scene,) = open_dataset(f"pair:{pair}/{name},{pair}/im1.png").scenes
    left, right = scene.load_images()
    assert left.shape == right.shape == (40, 48, 3)
    plain = to_gray(np.asarray(Image.open(pair / "im0.png"))).astype(int)
    assert np.abs(to_gray(left).astype(int) - plain).mean() < (40 if name == "a.jpg" else 12)
