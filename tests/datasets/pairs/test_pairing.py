import unicodedata
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semidense.datasets import DatasetError, LayoutError, open_dataset


@pytest.fixture
def views(tmp_path: Path) -> Callable[..., None]:
    def save(*names: str) -> None:
        for name in names:
            path = tmp_path / name
            path.parent.mkdir(exist_ok=True)
            Image.fromarray(np.zeros((4, 5), np.uint8)).save(path)

    return save


@pytest.mark.parametrize(
    ("names", "sides", "expected"),
    [
        pytest.param(["l/7.png", "l/8.png", "r/8.png", "r/7.png"], ("l", "r"), ["7", "8"], id="the same names"),
        pytest.param(["l/left_7.png", "r/right_7.png"], ("l", "r"), ["7"], id="names that tell the side"),
        pytest.param(["l/a_L.png", "l/a_R.png"], ("l/*_L.png", "l/*_R.png"), ["a"], id="patterns"),
        pytest.param(
            ["l/1.png", "l/notes.txt.png", "r/1.png", "r/notes.txt.png"], ("l", "r"), ["1", "notes_txt"], id="dots"
        ),
    ],
)
def test_views_are_paired_by_name(
    views: Callable[..., None], tmp_path: Path, names: list[str], sides: tuple[str, str], expected: list[str]
) -> None:
    views(*names)
    scenes = open_dataset("pair:" + ",".join(str(tmp_path / side) for side in sides)).scenes
    assert [scene.name for scene in scenes] == expected
    for scene in scenes:
        assert scene.files["left"] != scene.files["right"]


@pytest.mark.parametrize(
    ("names", "sides", "message"),
    [
        pytest.param(["l/1.png", "l/2.png", "r/3.png"], ("l", "r"), "no two names belong .*1.png and 3", id="none"),
        pytest.param(["l/a.png", "l/a.jpg", "r/a.png"], ("l", "r"), "a.jpg and .*a.png: several", id="twice"),
        pytest.param(["l/1.png", "r/1.png"], ("l", "r/1.png"), "one is a folder", id="a folder and a file"),
        pytest.param(["l/1.png"], ("l/*.png", "r/*"), "cannot be listed", id="no such folder"),
        pytest.param(["l/1.png"], ("l/*.png", "l/*.jpg"), "no image there", id="a pattern that fits nothing"),
        pytest.param(["l/1.png"], ("l/*.*", "l/*.png"), "exactly one", id="two stars"),
        pytest.param(["l/1.png"], ("l/1.png", "l/2.png"), "no such file", id="no such file"),
    ],
)  # fmt: skip
def test_views_without_a_counterpart_are_named(
    views: Callable[..., None], tmp_path: Path, names: list[str], sides: tuple[str, str], message: str
) -> None:
    views(*names)
    with pytest.raises((LayoutError, DatasetError), match=message):
        open_dataset("pair:" + ",".join(str(tmp_path / side) for side in sides))


def sides(folder: Path, *names: str) -> str:
    return "pair:" + ",".join(str(folder / name) for name in names)


@pytest.mark.parametrize(
    ("left", "right"),
    [
        pytest.param("кухня_1", "ванная_1", id="letters outside ASCII"),
        pytest.param("Böden", "Büden", id="umlauts"),
        pytest.param("turn_left_1", "turn_right_1", id="a side that is part of what is seen"),
        pytest.param("a-1", "a_1", id="another sign"),
        pytest.param("7", "007", id="leading zeros"),
        pytest.param("Frame1", "frame1", id="another case"),
        pytest.param("right_1", "left_1", id="exchanged sides"),
        pytest.param("left_1", "im1_1", id="words of two kinds"),
        pytest.param("scene1", "scene2", id="another number"),
    ],
)
def test_a_pairing_that_is_not_certain_is_refused_with_both_names(
    views: Callable[..., None], tmp_path: Path, left: str, right: str
) -> None:
    views(f"l/{left}.png", f"r/{right}.png")
    with pytest.raises(LayoutError) as refused:
        open_dataset(sides(tmp_path, "l", "r"))
    assert f"{left}.png" in str(refused.value)
    assert f"{right}.png" in str(refused.value)
    assert "pairs.csv" in str(refused.value)


def test_a_look_alike_is_not_left_out_in_silence(views: Callable[..., None], tmp_path: Path) -> None:
    views("l/b.png", "l/a-1.png", "r/b.png", "r/a_1.png")
    with pytest.raises(LayoutError, match=r"a-1.png and .*a_1.png: it is not certain"):
        open_dataset(sides(tmp_path, "l", "r"))


@pytest.mark.parametrize(
    ("lefts", "rights"),
    [
        pytest.param(["кухня_1", "ванная_1"], ["ванная_1", "кухня_1"], id="letters outside ASCII"),
        pytest.param(["Bo\u0308den", "Büden"], ["Böden", "Bu\u0308den"], id="composed and decomposed"),
        pytest.param(["turn_left_1", "turn_right_1"], ["turn_left_1", "turn_right_1"], id="equal names go first"),
        pytest.param(["a-1", "a_1"], ["a-1", "a_1"], id="signs tell names apart"),
        pytest.param(["left01", "left02"], ["right01", "right02"], id="a side before a number"),
        pytest.param(["01_L", "02_L"], ["01_R", "02_R"], id="a side at the end"),
        pytest.param(["im0_a", "im0_b"], ["im1_a", "im1_b"], id="Middlebury's"),
        pytest.param(["Left-0", "Left-1"], ["Right-0", "Right-1"], id="capitals"),
    ],
)
def test_names_that_belong_together_are_paired(
    views: Callable[..., None], tmp_path: Path, lefts: list[str], rights: list[str]
) -> None:
    views(*(f"one/{name}.png" for name in lefts), *(f"two/{name}.png" for name in rights))
    scenes = open_dataset(sides(tmp_path, "one", "two")).scenes
    found = {(plain(scene.files["left"].stem), plain(scene.files["right"].stem)) for scene in scenes}
    assert len(scenes) == len(lefts)
    assert all(one == other for one, other in found)


def plain(stem: str) -> str:
    """The name without its side, by hand: what these tests' names differ in."""
    stem = unicodedata.normalize("NFC", stem)
    for word in ("left0", "right0", "Left", "Right", "_L", "_R", "im0", "im1"):
        if "turn" not in stem:
            stem = stem.replace(word, "")
    return stem


def test_left_and_right_in_one_folder(views: Callable[..., None], tmp_path: Path) -> None:
    views(*(f"all/{side}{number}.png" for side in ("left", "right") for number in ("01", "02")))
    scenes = open_dataset(sides(tmp_path, "all", "all")).scenes
    assert [(scene.files["left"].name, scene.files["right"].name) for scene in scenes] == [
        ("left01.png", "right01.png"),
        ("left02.png", "right02.png"),
    ]


def test_a_missing_frame_is_left_out_and_named(views: Callable[..., None], tmp_path: Path) -> None:
    views("l/1.png", "l/2.png", "l/3.png", "r/1.png", "r/3.png", "r/4.png")
    scenes = open_dataset(sides(tmp_path, "l", "r")).scenes
    assert [scene.name for scene in scenes] == ["1", "3"]
    assert [warning.rsplit("/", 1)[-1] for warning in scenes[0].warnings] == [
        "r, left out: 2.png",
        "l, left out: 4.png",
    ]
    assert scenes[1].warnings == ()


def test_the_files_that_macos_adds_are_passed_over(views: Callable[..., None], tmp_path: Path) -> None:
    views("l/1.png", "r/1.png")
    for side in "lr":
        (tmp_path / side / "._1.png").write_bytes(b"Mac OS X")
    assert len(open_dataset(sides(tmp_path, "l", "r")).scenes) == 1
    assert len(open_dataset(sides(tmp_path, "l/*.png", "r/*.png")).scenes) == 1


@pytest.mark.parametrize(
    ("split", "rows", "columns"),
    [("side-by-side", slice(None), slice(3, None)), ("over-under", slice(2, None), slice(None))],
)
def test_one_picture_that_holds_both_views(tmp_path: Path, split: str, rows: slice, columns: slice) -> None:
    pixels = np.arange(24, dtype=np.uint8).reshape(4, 6)
    Image.fromarray(pixels).save(tmp_path / "both.png")
    (scene,) = open_dataset(f"pair:{tmp_path}/both.png,split={split}").scenes
    left, right = scene.load_images()
    assert right.tolist() == pixels[rows, columns].tolist()
    assert left.shape == right.shape == scene.size
    assert left[0, 0] == 0


def test_how_a_picture_is_split_is_part_of_what_the_images_are(tmp_path: Path) -> None:
    Image.fromarray(np.zeros((4, 6), np.uint8)).save(tmp_path / "both.png")
    specs = (f"pair:{tmp_path}/both.png,split={split}" for split in ("side-by-side", "over-under"))
    one, other = (open_dataset(spec).scenes[0].image_identity() for spec in specs)
    assert one != other


@pytest.mark.parametrize(
    ("given", "message"),
    [
        pytest.param("{0}/odd.png,split=side-by-side", "5 columns cannot be halved", id="odd"),
        pytest.param("{0}/odd.png,split=diagonal", "give side-by-side or over-under", id="unknown"),
        pytest.param("{0}/odd.png,{0}/odd.png,split=over-under", "give one path, not two", id="two paths"),
        pytest.param("{0}/none.png,split=over-under", "no such file", id="missing"),
    ],
)
def test_a_split_that_cannot_be_is_one_line(tmp_path: Path, given: str, message: str) -> None:
    Image.fromarray(np.zeros((4, 5), np.uint8)).save(tmp_path / "odd.png")
    with pytest.raises(DatasetError, match=message):
        open_dataset("pair:" + given.format(tmp_path))
