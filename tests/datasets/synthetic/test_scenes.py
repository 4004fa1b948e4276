from collections.abc import Callable

import numpy as np
import pytest

from semidense.datasets.errors import DatasetError
from semidense.datasets.occlusion import left_right_check, warped_truth_mask
from semidense.datasets.scene import DisparityRange, SceneSource
from semidense.datasets.synthetic.scenes import SyntheticOptions, list_scenes, parse_options

NAMES = ["train-0", "train-1", "train-2", "test-0", "test-1"]


def first(argument: str = "") -> SceneSource:
    return list_scenes(argument)[0]


@pytest.mark.parametrize("index", range(5), ids=NAMES)
def test_every_default_scene_keeps_its_promises(index: int, warp_correlation: Callable[..., float]) -> None:
    source = list_scenes()[index]
    scene = source.load()
    truth = scene.truth
    assert truth is not None
    assert truth.right is not None
    assert (source.name, source.split) == (NAMES[index], NAMES[index].split("-")[0])
    assert scene.left.shape == (96, 128, 3)
    assert scene.left.dtype == np.uint8
    assert source.disparities == DisparityRange(0, 20)
    for disparity in (truth.disparity, truth.right):
        assert 0 <= disparity.min() <= disparity.max() <= 20
    assert truth.mask == "exact"
    assert 0.7 < truth.nonocc.mean() < 0.97, "some of it must be occluded"
    assert warp_correlation(scene) > 0.98
    assert warp_correlation(scene) > max(warp_correlation(scene, scale) for scale in (-1, 0, 0.9, 1.1))
    assert (left_right_check(truth.disparity, truth.right) == truth.nonocc).mean() > 0.98
    assert (warped_truth_mask(truth.disparity) == truth.nonocc).mean() > 0.98


def test_the_same_options_give_the_same_scene() -> None:
    one, two = (first("noise=3,lighting=0.2").load() for _ in range(2))
    np.testing.assert_array_equal(one.left, two.left)
    np.testing.assert_array_equal(one.right, two.right)


def test_scenes_and_seeds_differ() -> None:
    views = [source.load().left.tobytes() for spec in ("", "seed=1") for source in list_scenes(spec)]
    assert len(set(views)) == 10


@pytest.mark.parametrize(
    "argument, field, value",
    [
        pytest.param("seed=3", "seed", 3, id="seed"),
        pytest.param(" lighting = 0.4 , noise=2", "lighting", 0.4, id="spaces"),
        pytest.param("noise=2", "noise", 2.0, id="a whole number where any may stand"),
        pytest.param("train=0,", "train", 0, id="comma at the end"),
    ],
)
def test_options_are_read(argument: str, field: str, value: float) -> None:
    assert getattr(parse_options(argument), field) == value


def test_no_argument_gives_the_defaults() -> None:
    assert parse_options("") == SyntheticOptions()


@pytest.mark.parametrize(
    "argument, message",
    [
        pytest.param("sed=3", "'sed' is not known; known are seed, train", id="unknown key"),
        pytest.param("seed=1,seed=2", "'seed' is given twice", id="twice"),
        pytest.param("seed", "seed=; expected a whole number", id="no value"),
        pytest.param("height=9.5", "height=9.5; expected a whole number", id="half a row"),
        pytest.param("noise=much", "noise=much; expected a number", id="word"),
        pytest.param("noise=nan", "noise=nan; it must be from 0 to 64", id="NaN"),
        pytest.param("height=0", "from 16 to 16384", id="no rows"),
        pytest.param("seed=-1", "from 0 to", id="negative seed"),
        pytest.param("width=40,disparities=21", "from 4 to 20", id="disparities above half the width"),
        pytest.param("textureless=1.1", "from 0 to 1", id="more than all"),
        pytest.param("height=16000,width=16000", "256,000,000 pixels", id="too large"),
    ],
)
def test_bad_options_are_one_line(argument: str, message: str) -> None:
    with pytest.raises(DatasetError) as caught:
        list_scenes(argument)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_size_and_counts_follow_the_options() -> None:
    sources = list_scenes("train=1,test=0,height=40,width=50,disparities=8")
    assert [source.name for source in sources] == ["train-0"]
    assert sources[0].load().left.shape == (40, 50, 3)
    assert sources[0].disparities == DisparityRange(0, 8)


def test_lighting_changes_the_right_view_alone() -> None:
    plain, lit = first().load(), first("lighting=0.8").load()
    np.testing.assert_array_equal(plain.left, lit.left)
    assert plain.right.mean() - lit.right.mean() > 30


def test_noise_is_of_the_strength_asked_for() -> None:
    plain, noisy = first().load(), first("noise=4").load()
    for one, two in ((plain.left, noisy.left), (plain.right, noisy.right)):
        difference = one.astype(float) - two
        assert 3.6 < difference.std() < 4.4
        assert abs(difference.mean()) < 0.2


def test_noise_of_the_two_views_is_independent() -> None:
    plain, noisy = first().load(), first("noise=4").load()
    left, right = noisy.left - plain.left.astype(float), noisy.right - plain.right.astype(float)
    assert abs(np.corrcoef(left.ravel(), right.ravel())[0, 1]) < 0.05


def flat_share(image: np.ndarray) -> float:
    """Share of pixels that equal their left and right neighbours in every channel."""
    same = (np.diff(image.astype(int), axis=1) == 0).all(axis=2)
    return float((same[:, 1:] & same[:, :-1]).mean())


@pytest.mark.parametrize(
    "share, low, high",
    [
        pytest.param(0, 0, 0.02, id="texture everywhere"),
        pytest.param(0.5, 0.3, 0.65, id="half"),
        pytest.param(1, 0.9, 1, id="flat but for the edges"),
    ],
)
def test_textureless_is_the_share_of_flat_area(share: float, low: float, high: float) -> None:
    flat = np.mean([flat_share(source.load_images()[0]) for source in list_scenes(f"textureless={share}")])
    assert low <= flat <= high


def test_difficulties_leave_the_truth_alone() -> None:
    plain, hard = first().load_truth(), first("lighting=1,textureless=0.7,noise=9").load_truth()
    assert plain is not None
    assert hard is not None
    np.testing.assert_array_equal(plain.disparity, hard.disparity)
    np.testing.assert_array_equal(plain.nonocc, hard.nonocc)


def test_identity_is_the_parameters() -> None:
    source = first("seed=7")
    assert source.identity()["files"] == {}
    assert source.identity()["parameters"]["seed"] == 7
    assert source.identity() != first("seed=8").identity()
    assert source.identity() != list_scenes("seed=7")[1].identity()
