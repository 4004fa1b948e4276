"""A data set of one's own, described in a file."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semidense.datasets import DatasetError, DisparityRange, open_dataset, write_pfm

Save = Callable[..., Path]
VIEWS = 'left = "left/*.png"\nright = "right/*.png"\n'
SCENES = 'left = "scenes/*/im0.png"\nright = "scenes/*/im1.png"\n'
TRUTH = np.array([[2, 3, np.inf, 5] * 2] * 3, np.float32)


@pytest.fixture
def folder(tmp_path: Path, save_image: Save) -> Path:
    for name in ("a", "b"):
        for place in (f"left/{name}.png", f"right/{name}.png", f"scenes/{name}/im0.png", f"scenes/{name}/im1.png"):
            save_image(tmp_path / place, np.full((3, 8), 90, np.uint8))
    for place in ("disp", "scenes/b"):
        (tmp_path / place).mkdir(exist_ok=True)
    write_pfm(tmp_path / "disp/b.pfm", TRUTH)
    Image.fromarray(np.where(np.isinf(TRUTH), 0, TRUTH * 16).astype(np.uint16)).save(tmp_path / "disp/b.png")
    return tmp_path


def described(folder: Path, text: str) -> str:
    (folder / "orchard.toml").write_text(text)
    return f"toml:{folder}/orchard.toml"


@pytest.mark.parametrize("views", [VIEWS, SCENES], ids=["by file", "by folder"])
@pytest.mark.parametrize(
    "truth",
    [
        pytest.param('truth = "disp/*.pfm"\n', id="PFM"),
        pytest.param('truth = "disp/*.png"\nscale = 16\n', id="an image of 16 steps to a pixel"),
    ],
)
def test_what_is_described_is_read(folder: Path, views: str, truth: str) -> None:
    one, other = open_dataset(described(folder, f'{views}{truth}split = "train"\n')).scenes
    assert [one.name, other.name] == ["a", "b"]
    assert (one.has_truth, one.open_ends) == (False, ("minimum", "maximum"))
    assert (other.dataset, other.split, other.disparities) == ("orchard", "train", DisparityRange(0, 5))
    loaded = other.load()
    assert loaded.truth is not None
    np.testing.assert_array_equal(loaded.truth.disparity, np.where(np.isinf(TRUTH), np.nan, TRUTH))
    assert loaded.left.tolist() == np.full((3, 8), 90).tolist()


def test_range_calibration_and_mask(folder: Path, save_image: Save) -> None:
    (folder / "K.txt").write_text("100 0 2 0 100 1 0 0 1 0.5")
    save_image(folder / "mask/b.png", np.full((3, 8), 255, np.uint8))
    text = f'{VIEWS}truth = "disp/*.pfm"\nmask = "mask/*.png"\ncalib = "K.txt"\nd_min = -1\nd_max = 3\n'
    for scene in open_dataset(described(folder, text)).scenes:
        assert (scene.disparities, scene.open_ends) == (DisparityRange(-1, 3), ())
        assert scene.calibration is not None
        assert scene.calibration.baseline == 500
    truth = scene.load_truth()
    assert truth is not None
    assert (truth.mask, int(truth.nonocc.sum())) == ("published", 18)


def test_the_scale_is_part_of_what_the_truth_is(folder: Path) -> None:
    texts = (f'{VIEWS}truth = "disp/*.png"\nscale = {scale}\n' for scale in (16, 32))
    one, other = (open_dataset(described(folder, text)).scenes[1] for text in texts)
    assert one.truth_identity() != other.truth_identity()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        pytest.param('left = "left/*.png"\n', 'no right; write a pattern such as right = "right/', id="no right"),
        pytest.param(VIEWS + "depth = 3\n", "depth is not known; known are left, right", id="unknown"),
        pytest.param(VIEWS + 'd_max = "far"\n', "d_max = 'far'; expected a whole number", id="text for a number"),
        pytest.param(VIEWS + "d_max = true\n", "d_max = True; expected a whole number", id="truth for a number"),
        pytest.param(VIEWS + "d_min = 0.5\n", "d_min = 0.5; expected a whole number", id="a part of a pixel"),
        pytest.param(VIEWS + 'scale = "1"\n', "scale = '1'; expected a number", id="text for a scale"),
        pytest.param(VIEWS + "d_min = 5\nd_max = 2\n", r"orchard\.toml: .*\[5, 2\] is empty", id="an empty range"),
        pytest.param(VIEWS + "d_max = 8\n", r"orchard\.toml: a: d_max=8, but .* only 8 px", id="a range too wide"),
        pytest.param(VIEWS + 'unit = "m"\n', "unit = 'm', but no calib; give both", id="a unit of nothing"),
        pytest.param(VIEWS + 'mask = "mask/*.png"\n', "mask = .*, but no truth; give both", id="a mask of nothing"),
        pytest.param(VIEWS + 'split = "val"\n', "split = 'val'; give train or test", id="split"),
        pytest.param(VIEWS + 'truth = "disp/*.png"\n', "no scale; truth is an image", id="no scale"),
        pytest.param(VIEWS + "scale = 0\n", "scale = 0", id="zero scale"),
        pytest.param(
            'left = "*/*.png"\nright = "right/*.png"\n',
            r"orchard\.toml: left = '\*/\*\.png'; give one \*",
            id="two stars",
        ),
        pytest.param('left = "none/*.png"\nright = "right/*.png"\n', "no left view", id="nothing there"),
        pytest.param('left = "left/*.png"\nright = "scenes/*/im1.jpg"\n', "no right view for .*a.png", id="no pair"),
        pytest.param('left = "/data/*.png"\nright = "right/*.png"\n', "left = '/data/.*relative to", id="absolute"),
        pytest.param(VIEWS + 'truth = ""\nscale = 1\n', "truth = ''; give a pattern", id="empty"),
        pytest.param(VIEWS + 'mask = "."\n', "mask = '.'; give a pattern", id="a folder alone"),
        pytest.param("left = [\n", "no valid TOML", id="no TOML"),
    ],
)
def test_a_bad_description_is_one_line(folder: Path, text: str, message: str) -> None:
    with pytest.raises(DatasetError, match=message) as refused:
        open_dataset(described(folder, text))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("role", ["truth", "truth_right", "mask", "calib"])
@pytest.mark.parametrize(
    ("pattern", "told"),
    [
        pytest.param("none/*.pfm", "finds nothing", id="nothing there"),
        pytest.param("none.pfm", "finds nothing", id="one file that is not there"),
        pytest.param("disp/x*.pfm", "finds no scene but y, and the first one is a", id="files of other scenes"),
    ],
)
def test_a_pattern_that_finds_nothing_of_any_scene_is_refused(folder: Path, role: str, pattern: str, told: str) -> None:
    write_pfm(folder / "disp/xy.pfm", TRUTH)
    others = "" if role == "truth" else 'truth = "disp/*.pfm"\n'
    with pytest.raises(DatasetError, match=rf"orchard\.toml: {role} = '.*' {told}; correct the pattern"):
        open_dataset(described(folder, f'{VIEWS}{others}{role} = "{pattern}"\nd_min = 0\nd_max = 5\n'))


def test_a_truth_of_another_size_is_named(folder: Path) -> None:
    write_pfm(folder / "disp/b.pfm", TRUTH[:2])
    (_, scene) = open_dataset(described(folder, f'{VIEWS}truth = "disp/*.pfm"\n')).scenes
    with pytest.raises(DatasetError, match=r"b\.pfm: truth of 2 x 8, but 3 x 8 is the images' size"):
        scene.load_truth()


def test_the_rendered_pair_as_a_description(stereo_data: Path, tmp_path: Path) -> None:
    source = stereo_data / "sceneflow"
    (tmp_path / "data").symlink_to(source)
    text = 'left = "data/*/left.png"\nright = "data/*/right.png"\ntruth = "data/*/disp0.pfm"\n'
    files = {path.name for path in (source / "flyingthings_0032_0006").iterdir()}
    assert {"left.png", "right.png", "disp0.pfm"} <= files
    (scene,) = open_dataset(described(tmp_path, text + 'truth_right = "data/*/disp1.pfm"\n')).scenes
    assert (scene.name, scene.size) == ("flyingthings_0032_0006", (540, 960))
    values = np.frombuffer((source / scene.name / "disp0.pfm").read_bytes()[-4 * 540 * 960 :], "<f4")
    assert scene.disparities == DisparityRange(0, int(np.ceil(values.max())))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('truth = "disp/*.png"\nscale = inf\n', "scale = inf; give the stored value of 1 px"),
        ('truth = "disp/*.png"\nscale = nan\n', "scale = nan"),
        ('truth = "disp/*.png"\nscale = 1e-320\n', "scale = "),
        (f'truth = "disp/*.png"\nscale = {"9" * 5000}\n', "no valid TOML"),
        ('truth = "disp/*.png"\nscale = 1\n', "a disparity of 80 px in an image of 8 px; give the scale"),
        ('truth = "disp/*.pfm"\ntruth_right = "disp/*.png"\n', "no scale; truth_right is an image"),
        ('truth = "disp/[b].pfm"\n', r"no \[, \] or"),
    ],
)
def test_what_no_truth_can_be_is_refused(folder: Path, text: str, message: str) -> None:
    with pytest.raises(DatasetError, match=message) as refused:
        open_dataset(described(folder, VIEWS + text))
    assert "\n" not in str(refused.value)


def test_a_pattern_may_begin_with_the_folder_itself_or_name_one_file(folder: Path) -> None:
    spec = described(folder, 'left = "./left/*.png"\nright = "./right/*.png"\n')
    assert [scene.name for scene in open_dataset(spec).scenes] == ["a", "b"]
    spec = described(folder, 'left = "left/a.png"\nright = "right/a.png"\n')
    assert [scene.name for scene in open_dataset(spec).scenes] == ["a"]


def test_a_pgm_that_would_be_scaled_is_refused(folder: Path) -> None:
    (folder / "disp/b.pgm").write_bytes(b"P5 8 3 100\n" + bytes([40] * 24))
    spec = described(folder, f'{VIEWS}truth = "disp/*.pgm"\nscale = 16\nd_max = 5\nd_min = 0\n')
    with pytest.raises(DatasetError, match="largest value is not 255 or 65535"):
        open_dataset(spec).scenes[1].load_truth()
    (folder / "disp/b.pgm").write_bytes(b"P5 # sixteenths\n8 3 255\n" + bytes([40] * 24))
    truth = open_dataset(spec).scenes[1].load_truth()
    assert truth is not None and (truth.disparity == 2.5).all()
